#include "test.h"

static test *first;
uint32 test_seed = 1;

void test_add(test *t)
{
    t->next = first;
    first = t;
}

int main(int argc, char **argv)
{
    if (argc < 2) {
        for (const test *t = first; t != NULL; t = t->next) {
            printf("%s\t%s\n", t->name, t->says);
        }
        return 0;
    }
    if (argc > 2) {
        test_seed = (uint32)strtoul(argv[2], NULL, 10);
    }
    for (const test *t = first; t != NULL; t = t->next) {
        if (strcmp(t->name, argv[1]) == 0) {
            alarm(50); /* seconds of real time; a busy host may give the test a tenth of its time */
            t->run();
            CHECK(lists_are_well_formed());
            _exit(0);
        }
    }
    fprintf(stderr, "no test is called %s\n", argv[1]);
    return 2;
}
