#include <sys/wait.h>

#include "test.h"

static test *first;
uint32 test_seed = 1;

void test_add(test *t)
{
    t->next = first;
    first = t;
}

static void run(const test *t)
{
    alarm(50); /* seconds of real time; a busy host may give the test a tenth of its time */
    t->run();
    CHECK(lists_are_well_formed());
    _exit(0);
}

/* Runs each test in a child process and prints its name and wait status. */
static void run_all(void)
{
    for (const test *t = first; t != NULL; t = t->next) {
        int status = -1;
        pid_t child = fork();
        if (child == 0) {
            run(t);
        }
        (void)waitpid(child, &status, 0);
        printf("%s %d\n", t->name, status);
        fflush(stdout);
    }
}

int main(int argc, char **argv)
{
    if (argc < 2) {
        for (const test *t = first; t != NULL; t = t->next) {
            printf("%s\t%s\n", t->name, t->says);
        }
        return 0;
    }
    if (strcmp(argv[1], "all") == 0) {
        run_all();
        return 0;
    }
    if (argc > 2) {
        test_seed = (uint32)strtoul(argv[2], NULL, 10);
    }
    for (const test *t = first; t != NULL; t = t->next) {
        if (strcmp(t->name, argv[1]) == 0) {
            run(t);
        }
    }
    fprintf(stderr, "no test is called %s\n", argv[1]);
    return 2;
}
