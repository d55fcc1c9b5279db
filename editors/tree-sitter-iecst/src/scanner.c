/* Comments, since they nest, and numbers whose point no digit follows.
 *
 * SPDX-License-Identifier: Apache-2.0 */

#include "tree_sitter/parser.h"

enum TokenType { COMMENT, NUMBER_WITH_POINT };

static void advance(TSLexer *lexer)
{
    lexer->advance(lexer, false);
}

static bool is_digit(int32_t c)
{
    return c >= '0' && c <= '9';
}

static bool is_word(int32_t c)
{
    return is_digit(c) || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
}

static bool is_blank(int32_t c)
{
    return c == ' ' || (c >= '\t' && c <= '\r');
}

/* A comment up to the end of the line. */
static bool scan_line(TSLexer *lexer)
{
    while (lexer->lookahead != '\n' && !lexer->eof(lexer))
        advance(lexer);
    lexer->mark_end(lexer);
    return true;
}

/* Called after the first character. As in the compiler, a comment within a comment that is not closed ends the outer one
 * at the first closing mark; a comment that is never closed takes the remaining text. */
static bool scan_comment(TSLexer *lexer, int32_t open, int32_t close)
{
    lexer->result_symbol = COMMENT;
    if (open == '/' && lexer->lookahead == '/')
        return scan_line(lexer);
    if (lexer->lookahead != '*')
        return false;
    advance(lexer);
    bool closed = false;
    for (unsigned depth = 1; !lexer->eof(lexer);) {
        int32_t c = lexer->lookahead;
        advance(lexer);
        if (c == open && lexer->lookahead == '*') {
            advance(lexer);
            depth++;
        } else if (c == '*' && lexer->lookahead == close) {
            advance(lexer);
            if (--depth == 0 || !closed)
                lexer->mark_end(lexer);
            if (depth == 0)
                return true;
            closed = true;
        }
    }
    if (!closed)
        lexer->mark_end(lexer);
    return true;
}

static bool scan_digits(TSLexer *lexer)
{
    bool any = false;
    for (; is_digit(lexer->lookahead); any = true)
        advance(lexer);
    return any;
}

/* `1.` is a number if no digit, letter or second point follows; the lexer of tree-sitter cannot look ahead. `1.E5` is
 * one, too. */
static bool scan_number(TSLexer *lexer)
{
    while (is_digit(lexer->lookahead) || lexer->lookahead == '_')
        advance(lexer);
    if (lexer->lookahead != '.')
        return false;
    advance(lexer);
    bool has_exponent = lexer->lookahead == 'e' || lexer->lookahead == 'E';
    if (has_exponent) {
        advance(lexer);
        if (lexer->lookahead == '+' || lexer->lookahead == '-')
            advance(lexer);
        if (!scan_digits(lexer))
            return false;
    }
    if (is_word(lexer->lookahead) || lexer->lookahead == '.')
        return false;
    lexer->mark_end(lexer);
    lexer->result_symbol = NUMBER_WITH_POINT;
    return true;
}

void *tree_sitter_iecst_external_scanner_create(void)
{
    return NULL;
}

void tree_sitter_iecst_external_scanner_destroy(void *payload)
{
    (void)payload;
}

unsigned tree_sitter_iecst_external_scanner_serialize(void *payload, char *buffer)
{
    (void)payload;
    (void)buffer;
    return 0;
}

void tree_sitter_iecst_external_scanner_deserialize(void *payload, const char *buffer, unsigned length)
{
    (void)payload;
    (void)buffer;
    (void)length;
}

bool tree_sitter_iecst_external_scanner_scan(void *payload, TSLexer *lexer, const bool *valid)
{
    (void)payload;
    while (is_blank(lexer->lookahead))
        lexer->advance(lexer, true);
    int32_t first = lexer->lookahead;
    if (valid[COMMENT] && (first == '(' || first == '/')) {
        advance(lexer);
        return scan_comment(lexer, first, first == '(' ? ')' : '/');
    }
    return valid[NUMBER_WITH_POINT] && is_digit(first) && scan_number(lexer);
}
