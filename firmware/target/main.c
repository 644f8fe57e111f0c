/* Runs recorded ticks on a bare Cortex-M4 so that the instructions of one can be counted. No C library.
 * data.h is written by validation/cortex_m4.py: JOINTS, TICKS, DT, gains, inputs. */
#include "data.h"
#include "hand_law.h"

static hand_real state[HAND_STATES * JOINTS], output[HAND_OUTPUTS * JOINTS];

static void finish(void)
{
    register long reason __asm__("r0") = 0x18, detail __asm__("r1") = 0x20026; /* semihosting: exit, done */
    __asm__ volatile("bkpt 0xab" : : "r"(reason), "r"(detail));
    for (;;) {}
}

void *memset(void *to, int value, unsigned long count)
{
    for (unsigned long k = 0; k < count; k++) ((volatile unsigned char *)to)[k] = (unsigned char)value;
    return to;
}

__attribute__((noinline)) static void run(void)
{
    hand_law_start(JOINTS, gains, state);
    for (int k = 0; k < TICKS; k++) {
        hand_law_tick(JOINTS, gains, state, &inputs[k * HAND_INPUTS * JOINTS], DT, 1, 1, output);
    }
    finish();
}

static void reset(void)
{
    *(volatile unsigned *)0xE000ED88 |= 0xFu << 20; /* CPACR: switch the floating-point unit on */
    __asm__ volatile("dsb\n isb");
    run();
}

extern unsigned stack_top;
__attribute__((section(".vectors"), used)) static void *const vectors[] = {&stack_top, (void *)reset, (void *)finish,
                                                                           (void *)finish};
