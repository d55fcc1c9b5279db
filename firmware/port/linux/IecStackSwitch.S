/*
 * IecStackSwitch.S - the way to an IEC stack and back.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 *   int IecStackSwitch(void (*fn)(void *arg), void *arg, IEC_STACK *stack, RTS_UI32 running);
 *   void IecStackSwitchBack(IEC_STACK *stack);
 *   void IecStackCallBelow(void (*fn)(void *arg), void *arg, uintptr_t stack_pointer);
 *
 * All registers that a function preserves are saved on the stack of the thread, so that nothing that IEC code may have
 * destroyed is used after it: neither its stack, nor a register it should have preserved, nor the flags of x86-64. The
 * record's `running` is set once the way back is known, and cleared once it has been taken. The copy of the saved stack
 * pointer on the IEC stack is for debuggers only.
 */
#define BACK 0
#define TOP __SIZEOF_POINTER__
#define RUNNING (2 * __SIZEOF_POINTER__)

    .text
    .globl IecStackSwitch
    .type IecStackSwitch, %function
    .globl IecStackSwitchBack
    .type IecStackSwitchBack, %function
    .globl IecStackCallBelow
    .type IecStackCallBelow, %function
    .hidden IecStackCallBelow
    .hidden IecStackSwitch
    .hidden IecStackSwitchBack
    .hidden IecStackOfThread

#if defined(__x86_64__)

IecStackSwitch:
    .cfi_startproc
    pushq %rbp
    .cfi_adjust_cfa_offset 8
    .cfi_rel_offset %rbp, 0
    pushq %rbx
    .cfi_adjust_cfa_offset 8
    .cfi_rel_offset %rbx, 0
    pushq %r12
    .cfi_adjust_cfa_offset 8
    .cfi_rel_offset %r12, 0
    pushq %r13
    .cfi_adjust_cfa_offset 8
    .cfi_rel_offset %r13, 0
    pushq %r14
    .cfi_adjust_cfa_offset 8
    .cfi_rel_offset %r14, 0
    pushq %r15
    .cfi_adjust_cfa_offset 8
    .cfi_rel_offset %r15, 0
    movq %rsp, BACK(%rdx)
    movq TOP(%rdx), %rax
    movq %rsp, -16(%rax)
    leaq -16(%rax), %rsp
    .cfi_remember_state
    .cfi_escape 0x0f, 5, 0x77, 0, 0x06, 0x23, 56 /* frame: what is at the stack pointer, plus 56 */
    movl %ecx, RUNNING(%rdx)
    movq %rdi, %rax
    movq %rsi, %rdi
    call *%rax
    movq IecStackOfThread@gottpoff(%rip), %rax
    movq %fs:(%rax), %rax
    xorl %ecx, %ecx
go_back:
    movq BACK(%rax), %rsp
    .cfi_restore_state
    pushq $0 /* the flags: neither backwards, nor with checks of the alignment */
    .cfi_adjust_cfa_offset 8
    popfq
    .cfi_adjust_cfa_offset -8
    movl $0, RUNNING(%rax)
    movl %ecx, %eax
    popq %r15
    .cfi_adjust_cfa_offset -8
    .cfi_restore %r15
    popq %r14
    .cfi_adjust_cfa_offset -8
    .cfi_restore %r14
    popq %r13
    .cfi_adjust_cfa_offset -8
    .cfi_restore %r13
    popq %r12
    .cfi_adjust_cfa_offset -8
    .cfi_restore %r12
    popq %rbx
    .cfi_adjust_cfa_offset -8
    .cfi_restore %rbx
    popq %rbp
    .cfi_adjust_cfa_offset -8
    .cfi_restore %rbp
    ret
    .cfi_endproc
    .size IecStackSwitch, . - IecStackSwitch

IecStackSwitchBack:
    movq %rdi, %rax
    movl $1, %ecx
    jmp go_back
    .size IecStackSwitchBack, . - IecStackSwitchBack

IecStackCallBelow:
    .cfi_startproc
    pushq %rbp
    .cfi_adjust_cfa_offset 8
    .cfi_rel_offset %rbp, 0
    movq %rsp, %rbp
    .cfi_def_cfa_register %rbp
    movq %rdx, %rsp
    andq $-16, %rsp
    movq %rdi, %rax
    movq %rsi, %rdi
    call *%rax
    movq %rbp, %rsp
    popq %rbp
    .cfi_def_cfa %rsp, 8
    .cfi_restore %rbp
    ret
    .cfi_endproc
    .size IecStackCallBelow, . - IecStackCallBelow

#elif defined(__aarch64__)

IecStackSwitch:
    .cfi_startproc
    stp x29, x30, [sp, #-160]!
    .cfi_def_cfa_offset 160
    .cfi_offset x29, -160
    .cfi_offset x30, -152
    stp x19, x20, [sp, #16]
    .cfi_offset x19, -144
    .cfi_offset x20, -136
    stp x21, x22, [sp, #32]
    .cfi_offset x21, -128
    .cfi_offset x22, -120
    stp x23, x24, [sp, #48]
    .cfi_offset x23, -112
    .cfi_offset x24, -104
    stp x25, x26, [sp, #64]
    .cfi_offset x25, -96
    .cfi_offset x26, -88
    stp x27, x28, [sp, #80]
    .cfi_offset x27, -80
    .cfi_offset x28, -72
    stp d8, d9, [sp, #96]
    stp d10, d11, [sp, #112]
    stp d12, d13, [sp, #128]
    stp d14, d15, [sp, #144]
    mov x5, sp
    str x5, [x2, #BACK]
    ldr x4, [x2, #TOP]
    str x5, [x4, #-16]!
    mov sp, x4
    .cfi_remember_state
    .cfi_escape 0x0f, 6, 0x8f, 0, 0x06, 0x23, 160, 1 /* frame: what is at the stack pointer, plus 160 */
    str w3, [x2, #RUNNING]
    mov x9, x0
    mov x0, x1
    blr x9
    mrs x0, tpidr_el0
    adrp x1, :gottprel:IecStackOfThread
    ldr x1, [x1, :gottprel_lo12:IecStackOfThread]
    ldr x0, [x0, x1]
    mov w1, #0
go_back:
    ldr x2, [x0, #BACK]
    mov sp, x2
    .cfi_restore_state
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
    .cfi_def_cfa_offset 0
    .cfi_restore x29
    .cfi_restore x30
    ret
    .cfi_endproc
    .size IecStackSwitch, . - IecStackSwitch

IecStackSwitchBack:
    mov w1, #1
    b go_back
    .size IecStackSwitchBack, . - IecStackSwitchBack

IecStackCallBelow:
    .cfi_startproc
    stp x29, x30, [sp, #-16]!
    .cfi_def_cfa_offset 16
    .cfi_offset x29, -16
    .cfi_offset x30, -8
    mov x29, sp
    .cfi_def_cfa_register x29
    mov sp, x2
    mov x9, x0
    mov x0, x1
    blr x9
    mov sp, x29
    .cfi_def_cfa_register sp
    ldp x29, x30, [sp], #16
    .cfi_def_cfa_offset 0
    .cfi_restore x29
    .cfi_restore x30
    ret
    .cfi_endproc
    .size IecStackCallBelow, . - IecStackCallBelow

#elif defined(__arm__)

    .syntax unified
    .arch armv7-a
    .fpu vfpv3-d16
    .thumb
    .cfi_sections .debug_frame

    .thumb_func
IecStackSwitch:
    .cfi_startproc
    push {r3-r11, lr} /* r3: an even number of registers keeps the alignment */
    .cfi_def_cfa_offset 40
    .cfi_offset r4, -36
    .cfi_offset r5, -32
    .cfi_offset r6, -28
    .cfi_offset r7, -24
    .cfi_offset r8, -20
    .cfi_offset r9, -16
    .cfi_offset r10, -12
    .cfi_offset r11, -8
    .cfi_offset lr, -4
    vpush {d8-d15}
    .cfi_def_cfa_offset 104
    mov r12, sp
    str r12, [r2, #BACK]
    ldr r4, [r2, #TOP]
    str r12, [r4, #-16]!
    mov sp, r4
    .cfi_remember_state
    .cfi_escape 0x0f, 5, 0x7d, 0, 0x06, 0x23, 104 /* frame: what is at the stack pointer, plus 104 */
    str r3, [r2, #RUNNING]
    mov r12, r0
    mov r0, r1
    blx r12
    ldr r1, 2f
1:  add r1, pc
    ldr r1, [r1]
    mrc p15, 0, r0, c13, c0, 3
    ldr r0, [r0, r1]
    movs r1, #0
go_back:
    ldr r2, [r0, #BACK]
    mov sp, r2
    .cfi_restore_state
    movs r3, #0
    str r3, [r0, #RUNNING]
    mov r0, r1
    vpop {d8-d15}
    .cfi_def_cfa_offset 40
    pop {r3-r11, pc}
    .cfi_endproc
    .align 2
2:  .word IecStackOfThread(gottpoff) + (. - 1b - 4)
    .size IecStackSwitch, . - IecStackSwitch

    .thumb_func
IecStackSwitchBack:
    movs r1, #1
    b go_back
    .size IecStackSwitchBack, . - IecStackSwitchBack

    .thumb_func
IecStackCallBelow:
    .cfi_startproc
    push {r7, lr}
    .cfi_def_cfa_offset 8
    .cfi_offset r7, -8
    .cfi_offset lr, -4
    mov r7, sp
    .cfi_def_cfa_register r7
    mov sp, r2
    mov r12, r0
    mov r0, r1
    blx r12
    mov sp, r7
    .cfi_def_cfa_register sp
    pop {r7, pc}
    .cfi_endproc
    .size IecStackCallBelow, . - IecStackCallBelow

#else
#error "IecStackSwitch.S: switch stacks on this architecture as the others do."
#endif

    .section .note.GNU-stack, "", %progbits
