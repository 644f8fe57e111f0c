/* board_replay FILE: calls of the board sample with their results, as validation/c_board.py writes them. Exit code 0
 * where every result is equal, 1 where one differs, 2 without a file. */
#include <stdio.h>
#include <stdlib.h>

#include "board_replay.h"

int main(int argc, char **argv)
{
    FILE *file = (argc == 2) ? fopen(argv[1], "rb") : NULL;
    if (file == NULL) {
        return 2;
    }
    (void)fseek(file, 0, SEEK_END);
    const size_t size = (size_t)ftell(file);
    rewind(file);
    uint32_t *words = malloc(size + 4U);
    const size_t got = (words != NULL) ? fread(words, 4U, size / 4U, file) : 0U;
    (void)fclose(file);
    const size_t differs = (got > 0U) ? board_replay(words, got) : 1U;
    (void)printf("%zu events, %s %zu\n", board_replay_compared(), (differs == 0U) ? "all equal" : "differs at", differs);
    free(words);
    return (differs == 0U) ? 0 : 1;
}
