/*
 * test_core_sha256.c - SHA-256 and HMAC give the digests of the standards.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "Sha256.h"
#include "test.h"

static char hex[2 * SHA256_SIZE + 1];

static const char *shown(const RTS_UI8 *digest)
{
    for (int i = 0; i < SHA256_SIZE; i++)
        snprintf(hex + 2 * i, 3, "%02x", digest[i]);
    return hex;
}

static const char *sum_of(const void *data, RTS_UI32 size)
{
    RTS_UI8 digest[SHA256_SIZE];
    SHA256 sum;

    Sha256Begin(&sum);
    Sha256Add(&sum, data, size);
    Sha256End(&sum, digest);
    return shown(digest);
}

#define CHECK_TEXT(actual, expected) CHECK(strcmp(actual, expected) == 0)

/* FIPS 180-4's examples (csrc.nist.gov, SHA256.pdf). */
static void the_examples_of_the_standard(void)
{
    static const char two_blocks[] = "abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq";

    CHECK_TEXT(sum_of("abc", 3), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    CHECK_TEXT(sum_of("", 0), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
    CHECK_TEXT(sum_of(two_blocks, sizeof(two_blocks) - 1),
               "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
}

static void a_million_bytes(void)
{
    static const char part[1000] = "";
    char bytes[sizeof(part)];
    RTS_UI8 digest[SHA256_SIZE];
    SHA256 sum;

    memset(bytes, 'a', sizeof(bytes));
    Sha256Begin(&sum);
    for (int i = 0; i < 1000; i++)
        Sha256Add(&sum, bytes, sizeof(bytes));
    Sha256End(&sum, digest);
    CHECK_TEXT(shown(digest), "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

/* Bytes 0, 1, 2 ... up to each length at which the padding changes its form (from Python's hashlib). */
static void lengths_around_the_end_of_a_block(void)
{
    static const struct {
        RTS_UI32 size;
        const char *digest;
    } cases[] = {
        {55, "463eb28e72f82e0a96c0a4cc53690c571281131f672aa229e0d45ae59b598b59"},
        {56, "da2ae4d6b36748f2a318f23e7ab1dfdf45acdc9d049bd80e59de82a60895f562"},
        {63, "29af2686fd53374a36b0846694cc342177e428d1647515f078784d69cdb9e488"},
        {64, "fdeab9acf3710362bd2658cdc9a29e8f9c757fcf9811603a8c447cd1d9151108"},
        {65, "4bfd2c8b6f1eec7a2afeb48b934ee4b2694182027e6d0fc075074f2fabb31781"},
        {119, "da18797ed7c3a777f0847f429724a2d8cd5138e6ed2895c3fa1a6d39d18f7ec6"},
        {120, "f52b23db1fbb6ded89ef42a23ce0c8922c45f25c50b568a93bf1c075420bbb7c"},
        {128, "471fb943aa23c511f6f72f8d1652d9c880cfa392ad80503120547703e56a2be5"},
    };
    RTS_UI8 bytes[128];

    for (RTS_UI32 i = 0; i < sizeof(bytes); i++)
        bytes[i] = (RTS_UI8)i;
    for (RTS_UI32 i = 0; i < RTS_COUNT(cases); i++)
        CHECK_TEXT(sum_of(bytes, cases[i].size), cases[i].digest);
}

/* RFC 4231, 4.2 to 4.5; a key of fewer bytes is one with zeros after them. */
static void hmac_of_rfc_4231(void)
{
    static const struct {
        const char *key, *data, *digest;
    } cases[] = {
        {"\x0b\x0b\x0b\x0b\x0b\x0b\x0b\x0b\x0b\x0b\x0b\x0b\x0b\x0b\x0b\x0b\x0b\x0b\x0b\x0b", "Hi There",
         "b0344c61d8db38535ca8afceaf0bf12b881dc200c9833da726e9376c2e32cff7"},
        {"Jefe", "what do ya want for nothing?", "5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843"},
    };

    for (RTS_UI32 i = 0; i < RTS_COUNT(cases); i++) {
        RTS_UI8 key[SHA256_SIZE] = {0};
        RTS_UI8 digest[SHA256_SIZE];
        SHA256 sum;
        memcpy(key, cases[i].key, strlen(cases[i].key));
        HmacBegin(&sum, key);
        Sha256Add(&sum, cases[i].data, (RTS_UI32)strlen(cases[i].data));
        HmacEnd(&sum, key, digest);
        CHECK_TEXT(shown(digest), cases[i].digest);
    }
}

static void every_bit_counts_in_a_comparison(void)
{
    RTS_UI8 a[SHA256_SIZE] = {0};
    RTS_UI8 b[SHA256_SIZE] = {0};

    CHECK(Sha256IsEqual(a, b));
    for (int bit = 0; bit < 8 * SHA256_SIZE; bit++) {
        b[bit / 8] ^= (RTS_UI8)(1 << bit % 8);
        CHECK(!Sha256IsEqual(a, b));
        b[bit / 8] = 0;
    }
}

int main(void)
{
    RUN(the_examples_of_the_standard);
    RUN(a_million_bytes);
    RUN(lengths_around_the_end_of_a_block);
    RUN(hmac_of_rfc_4231);
    RUN(every_bit_counts_in_a_comparison);
    return test_result();
}
