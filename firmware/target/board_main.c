/* Replays recorded calls of the board sample on a bare Cortex-M4. The emulator ends with 0 where every result is the
 * recorded one. trace.h is written by validation/cortex_m4.py: TRACE_WORDS, trace. */
#include "board_replay.h"
#include "trace.h"

#define EXIT (0x18L)
#define DONE (0x20026L)  /* semihosting: the application ended */
#define ERROR (0x20023L) /* semihosting: run-time error */

static void finish(long how)
{
    register long reason __asm__("r0") = EXIT;
    register long detail __asm__("r1") = how;
    __asm__ volatile("bkpt 0xab" : : "r"(reason), "r"(detail));
    for (;;) {}
}

void *memset(void *to, int value, size_t count)
{
    for (size_t k = 0; k < count; k++) {
        ((volatile unsigned char *)to)[k] = (unsigned char)value;
    }
    return to;
}

void *memcpy(void *to, const void *from, size_t count)
{
    for (size_t k = 0; k < count; k++) {
        ((volatile unsigned char *)to)[k] = ((const unsigned char *)from)[k];
    }
    return to;
}

static void failed(void)
{
    finish(ERROR);
}

static void reset(void)
{
    *(volatile unsigned *)0xE000ED88 |= 0xFu << 20; /* CPACR: switch the floating-point unit on */
    __asm__ volatile("dsb\n isb");
    finish(((board_replay(trace, TRACE_WORDS) == 0U) && (board_replay_compared() > 0U)) ? DONE : ERROR);
}

extern unsigned stack_top;
__attribute__((section(".vectors"), used)) static const struct {
    unsigned *stack;
    void (*handlers[3])(void); /* reset, non-maskable interrupt, hard fault */
} vectors = {&stack_top, {reset, failed, failed}};
