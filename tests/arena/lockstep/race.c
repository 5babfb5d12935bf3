// Test of lockstep.c for the thread sanitizer: threads run rounds of robots that only count their runs, without Python.
//
//     cc -fsanitize=thread -include lockstep.c race.c -lpthread
//
// Prints the runs by worker. Exits with 0 if each robot ran once per round and never in two threads at the same time.

extern int printf(const char *, ...);
extern int pthread_create(unsigned long *, const void *, void *(*)(void *), void *);
extern int pthread_join(unsigned long, void **);
extern int sem_init(void *, int, unsigned);
extern int sem_wait(void *);
extern int sem_post(void *);
extern int sched_yield(void);

enum { ROBOTS = 7, WORKERS = 3, ROUNDS = 20000 };

static i64 runs[ROBOTS];
static struct native natives[ROBOTS];
static struct robot robots[ROBOTS], *all[ROBOTS], *ready[ROBOTS];
static struct worker workers[WORKERS];
static char locks[WORKERS][64];
static u64 begins[ROBOTS];
static struct native_world native_world;
static struct scheduler scheduler;

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

static void *thread_main(void *worker)
{
    worker_main(&scheduler, worker);
    return 0;
}

int main(void)
{
    unsigned long threads[WORKERS];
    for (i64 i = 0; i < ROBOTS; i++) {
        natives[i].entry = entry, natives[i].record = &runs[i], natives[i].begins = &begins[i];
        natives[i].interpret = 1, natives[i].service = 2;
        robots[i].native = &natives[i];
        all[i] = &robots[i];
    }
    for (i64 i = 0; i < WORKERS; i++) {
        sem_init(locks[i], 0, 0);
        workers[i].lock = locks[i];
    }
    scheduler = (struct scheduler){.count = ROBOTS,
                                   .robots = all,
                                   .native_world = &native_world,
                                   .worker_count = WORKERS,
                                   .workers = workers,
                                   .acquire = acquire,
                                   .release = release,
                                   .ready = ready};
    for (i64 i = 0; i < WORKERS; i++)
        pthread_create(&threads[i], 0, thread_main, &workers[i]);
    i64 expected[ROBOTS] = {0}, wrong = 0;
    for (i64 round = 0; round < ROUNDS; round++) {
        for (i64 i = 0; i < ROBOTS; i++)
            if ((round * 31 + i * 17) % 5) // selects different robots in each round
                robots[i].state = RUNNABLE, expected[i]++;
        for (i64 i; (i = run_all(&scheduler, 0)) != REACHED;)
            wrong += robots[i].state != IN_PYTHON || robots[i].exit_reason != 7;
        if (round % 1000 == 0) // leaves the workers time to block
            for (i64 i = 0; i < 20000; i++)
                sched_yield();
    }
    stop_workers(&scheduler);
    i64 worker_runs = 0;
    for (i64 i = 0; i < WORKERS; i++) {
        pthread_join(threads[i], 0);
        worker_runs += workers[i].runs;
    }
    for (i64 i = 0; i < ROBOTS; i++)
        wrong += runs[i] != expected[i];
    printf("%ld\n", (long)worker_runs);
    return wrong || !worker_runs;
}
