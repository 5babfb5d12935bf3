// Rounds of lockstep.c between threads, for a sanitizer: robots that count what is done to them, no Python.
//
//     cc -fsanitize=thread -include lockstep.c race.c -lpthread
//
// Says nothing and ends with 0 if each robot was run once in every round, and no thread twice at a time.

extern int printf(const char *, ...);
extern int pthread_create(unsigned long *, const void *, void *(*)(void *), void *);
extern int pthread_join(unsigned long, void **);
extern int sem_init(void *, int, unsigned);
extern int sem_wait(void *);
extern int sem_post(void *);
extern int sched_yield(void);

enum { ROBOTS = 7, HELPERS = 3, ROUNDS = 20000 };

static i64 runs[ROBOTS];
static struct native natives[ROBOTS];
static struct robot robots[ROBOTS], *all[ROBOTS], *ready[ROBOTS];
static struct helper helpers[HELPERS];
static char locks[HELPERS][64];
static u64 begins[ROBOTS];
static struct ground ground;
static struct swarm swarm;

static i64 entry(void *record, void *env)
{
    (void)env;
    ++*(i64 *)record;
    return 7;
}

static int acquire(void *lock, int waits)
{
    (void)waits;
    return sem_wait(lock);
}

static void release(void *lock)
{
    sem_post(lock);
}

static void *life(void *helper)
{
    help(&swarm, helper);
    return 0;
}

int main(void)
{
    unsigned long threads[HELPERS];
    for (i64 i = 0; i < ROBOTS; i++) {
        natives[i].entry = entry, natives[i].record = &runs[i], natives[i].begins = &begins[i];
        natives[i].interpret = 1, natives[i].service = 2;
        robots[i].native = &natives[i];
        all[i] = &robots[i];
    }
    for (i64 i = 0; i < HELPERS; i++) {
        sem_init(locks[i], 0, 0);
        helpers[i].lock = locks[i];
    }
    swarm = (struct swarm){.count = ROBOTS,
                           .robots = all,
                           .ground = &ground,
                           .helpers = HELPERS,
                           .helper = helpers,
                           .acquire = acquire,
                           .release = release,
                           .ready = ready};
    for (i64 i = 0; i < HELPERS; i++)
        pthread_create(&threads[i], 0, life, &helpers[i]);
    i64 expected[ROBOTS] = {0}, wrong = 0;
    for (i64 round = 0; round < ROUNDS; round++) {
        for (i64 i = 0; i < ROBOTS; i++)
            if ((round * 31 + i * 17) % 5) // another choice of robots in each round
                robots[i].stands = RUNS, expected[i]++;
        for (i64 i; (i = run_all(&swarm, 0)) != OVER;)
            wrong += robots[i].stands != AWAY || robots[i].why != 7;
        if (round % 1000 == 0) // long enough for helpers to fall asleep
            for (i64 i = 0; i < 20000; i++)
                sched_yield();
    }
    dismiss(&swarm);
    i64 helped = 0;
    for (i64 i = 0; i < HELPERS; i++) {
        pthread_join(threads[i], 0);
        helped += helpers[i].runs;
    }
    for (i64 i = 0; i < ROBOTS; i++)
        wrong += runs[i] != expected[i];
    printf("%ld\n", (long)helped);
    return wrong || !helped;
}
