/*
 * IecStackSwitch.S - the way to an IEC stack and back on macOS, as ../linux/IecStackSwitch.S has it.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * What differs is the system's: names begin with an underscore, and the address of a variable of the thread comes from a
 * function, which is called on the IEC stack after its code has returned.
 */
#if !defined(__aarch64__)
#error "IecStackSwitch.S: macOS on Arm only."
#endif

#define BACK 0
#define TOP 8
#define RUNNING 16

    .text
    .globl _IecStackSwitch
    .globl _IecStackSwitchBack
    .globl _IecStackCallBelow
    .private_extern _IecStackSwitch
    .private_extern _IecStackSwitchBack
    .private_extern _IecStackCallBelow

    .p2align 2
_IecStackSwitch:
    stp x29, x30, [sp, #-160]!
    stp x19, x20, [sp, #16]
    stp x21, x22, [sp, #32]
    stp x23, x24, [sp, #48]
    stp x25, x26, [sp, #64]
    stp x27, x28, [sp, #80]
    stp d8, d9, [sp, #96]
    stp d10, d11, [sp, #112]
    stp d12, d13, [sp, #128]
    stp d14, d15, [sp, #144]
    mov x5, sp
    str x5, [x2, #BACK]
    ldr x4, [x2, #TOP]
    sub x4, x4, #16
    mov sp, x4
    str w3, [x2, #RUNNING]
    mov x9, x0
    mov x0, x1
    blr x9
    adrp x0, _IecStackOfThread@TLVPPAGE
    ldr x0, [x0, _IecStackOfThread@TLVPPAGEOFF]
    ldr x1, [x0]
    blr x1
    ldr x0, [x0]
    mov w1, #0
go_back:
    ldr x2, [x0, #BACK]
    mov sp, x2
    str wzr, [x0, #RUNNING]
    mov w0, w1
    ldp x19, x20, [sp, #16]
    ldp x21, x22, [sp, #32]
    ldp x23, x24, [sp, #48]
    ldp x25, x26, [sp, #64]
    ldp x27, x28, [sp, #80]
    ldp d8, d9, [sp, #96]
    ldp d10, d11, [sp, #112]
    ldp d12, d13, [sp, #128]
    ldp d14, d15, [sp, #144]
    ldp x29, x30, [sp], #160
    ret

    .p2align 2
_IecStackSwitchBack:
    mov w1, #1
    b go_back

    .p2align 2
_IecStackCallBelow:
    stp x29, x30, [sp, #-16]!
    mov x29, sp
    mov sp, x2
    mov x9, x0
    mov x0, x1
    blr x9
    mov sp, x29
    ldp x29, x30, [sp], #16
    ret

    .subsections_via_symbols
