/* One function for each kind of code in which test_prove.py plants a fault. */
struct pair { int first, second; };
extern volatile unsigned first_port, second_port;
extern volatile unsigned long wide_port;
extern int outside(int, int);
extern int another(int, int);
int words[8];

int larger(int a, int b) { return a > b ? a : b; }
unsigned shifted(unsigned a) { return a >> 3; }
int halved(int a) { return a >> 1; }
long difference(long a, long b) { return a - b; }
long product(int a, int b) { return (long)a * b; }
unsigned quotient(unsigned a, unsigned b) { return a / b; }
int widened(signed char *p) { return p[1]; }
void stored(struct pair *p, int a, int b) { p->first = b; p->second = a; }
void copied(unsigned char *p, unsigned char *q) { q[2] = p[1]; }
unsigned ports(void) { unsigned a = first_port; second_port = a; first_port = 7; return a; }
void one_bit(void) { first_port |= 0x0400; }
int kept(int a) { return outside(a, 3) + a; }
int decided(unsigned a) { if (a & 4) return outside(1, a); return another(a, 2); }
int local(int i)
{
    int list[4];
    list[0] = i; list[1] = 2; list[2] = 3; list[3] = i + 1;
    return outside(list[i & 3], i);
}
int chosen(unsigned a)
{
    switch (a) {
    case 0: return outside(9, 1);
    case 1: return another(11, 2);
    case 2: return outside(14, 7);
    case 3: return another(2, 21);
    case 4: return outside(31, 12);
    default: return -1;
    }
}
int indexed(unsigned i) { return words[i]; }
int summed(void)
{
    int s = 0;
    for (int i = 0; i < 8; i++) s += words[i];
    return s;
}
float scaled(float a, float b) { return a * b + 1.0f; }
int below(float a, float b) { return a < b; }
void guarded(void) { words[0] = 1; __asm__ volatile("" ::: "memory"); first_port = 1; words[1] = 2; }
void barrier(void) { __asm__ volatile("disi #5"); first_port = 1; }
unsigned long wide(void) { return wide_port; }
extern int use(int *);
int by_reference(int a) { return use(&a); }
int by_reference_and_read(int a) { int b = a; return use(&b) + b; }
extern void *memcpy(void *, const void *, unsigned);
int filled(char *from, unsigned count)
{
    char list[4];
    list[0] = list[1] = list[2] = list[3] = 7;
    memcpy(list, from, count);
    return list[1];
}
struct __attribute__((packed)) packed { char first; int second; } packed_pair;
int packed(void) { return packed_pair.second; }
struct many { long first, second; int list[4]; };
void copied_whole(struct many *to, struct many *from) { *to = *from; }
const int constants[4] = {1, 2, 3, 5};
int constant(int i) { return constants[i & 3]; }
extern void serve(void);
void __attribute__((interrupt)) _T1Interrupt(void) { serve(); }
void __attribute__((interrupt)) _T2Interrupt(void) { words[0] = constants[first_port & 3]; }
#define BARRIER() __asm__ volatile("" ::: "memory")
void critical(void) { first_port = 1; BARRIER(); words[0] = 1; BARRIER(); first_port = 0; }
void between(int *p) { BARRIER(); first_port = 1; *p = 3; words[0] = 1; second_port = 2; BARRIER(); }
volatile int seen;
int watched(void) { seen = 1; return seen; }
int watched_local(void) { volatile int own = 1; return own + own; }
float sign_taken(float a, float b) { return __builtin_copysignf(a, b); }
int is_subnormal(float a) { return __builtin_isfpclass(a, 0x90); }
unsigned long added(unsigned long a, unsigned long b)
{
    __asm__("add %0,%1,%0\n addc %d0,%d1,%d0" : "+r"(a) : "r"(b) : "cc");
    return a;
}
void put(int *p, int a) { __asm__ volatile("mov %1,[%0]" : : "r"(p), "r"(a) : "memory"); }
int early(int a, int b)
{
    int r;
    __asm__("mov %1,%0\n add %0,%2,%0\n mov #%3,w7" : "=&r"(r) : "r"(a), "r"(b), "i"(5) : "w7");
    return r + a;
}
struct item { struct item *next; int key; };
struct item *found(struct item *p, int key)
{
    while (p && p->key != key) p = p->next;
    return p;
}
unsigned length(const char *s)
{
    unsigned n = 0;
    while (*s++) n++;
    return n;
}
int pairs(int n, int (*f)(int, int))
{
    int total = 0;
    for (int i = 0; i < n; i++)
        for (int j = i; j < n; j++) total += f(i, j);
    return total;
}
int place_of(int k)
{
    int i = 0;
    while (i < 8 && words[i] != k) i++;
    return i < 8 ? i : -1;
}
void inserted(struct item **p, struct item *x)
{
    while (*p && (*p)->key < x->key) p = &(*p)->next;
    x->next = *p;
    *p = x;
}
void turned(int *a, int n)
{
    for (int i = 0, j = n - 1; i < j; i++, j--) {
        int t = a[i];
        a[i] = a[j];
        a[j] = t;
    }
}
void waited(void)
{
    while (!(first_port & 4)) {}
    second_port = 1;
}
long product_of(const int *a, const int *b, int n)
{
    long s = 0;
    while (n-- > 0) s += (long)*a++ * *b++;
    return s;
}
