/* What a Cortex-M7 does before main: it takes its stack and its first instruction from the vectors at address 0. */

extern char stack_top[];
void _mainCRTStartup(void); /* of newlib: calls main, with input and output by the debugger */
void Reset_Handler(void);

void Reset_Handler(void)
{
    volatile unsigned *const coprocessor_access = (volatile unsigned *)0xE000ED88u;
    *coprocessor_access |= 0xFu << 20; /* the floating-point unit, coprocessors 10 and 11 */
    __asm volatile("dsb\n\tisb");
    _mainCRTStartup();
}

__attribute__((section(".vectors"), used)) static void (*const vectors[])(void) = {
    (void (*)(void))stack_top,
    Reset_Handler,
};
