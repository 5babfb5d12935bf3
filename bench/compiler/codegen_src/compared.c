/* Functions of known size under XC16 (abi-elf.md §8.2). None uses another one, so sizes compare one to one. */
int sat(int a, int lo, int hi) { return a < lo ? lo : a > hi ? hi : a; }

unsigned crc16(const unsigned char *p, int n)
{
    unsigned c = 0xFFFF;
    int k;
    while (n--) {
        c ^= *p++;
        for (k = 0; k < 8; k++)
            c = (c & 1) ? (c >> 1) ^ 0xA001 : c >> 1;
    }
    return c;
}

long dot(const int *a, const int *b, int n)
{
    long s = 0;
    while (n--)
        s += (long)*a++ * *b++;
    return s;
}

struct node {
    struct node *next;
    int key;
    char tag;
};
struct node *find(struct node *l, int key)
{
    for (; l; l = l->next)
        if (l->key == key && l->tag == 'x')
            return l;
    return 0;
}

int itoa10(unsigned v, char *out)
{
    char t[6];
    int n = 0, m = 0;
    do {
        t[n++] = '0' + v % 10;
        v /= 10;
    } while (v);
    while (n)
        out[m++] = t[--n];
    out[m] = 0;
    return m;
}

long add32(long a, long b) { return a + b; }
long sub32(long a, long b) { return a - b; }
long neg32(long a) { return -a; }
long shl1(long a) { return a << 1; }
long sar1(long a) { return a >> 1; }
int lt32(long a, long b) { return a < b; }
int ltu32(unsigned long a, unsigned long b) { return a < b; }
int eq32(long a, long b) { return a == b; }
unsigned long shlv32(unsigned long a, int n) { return a << n; }
int mul16(int a, int b) { return a * b; }
long mulss(int a, int b) { return (long)a * b; }
unsigned long muluu(unsigned a, unsigned b) { return (unsigned long)a * b; }
long mul32(long a, long b) { return a * b; }
int div16(int a, int b) { return a / b; }
int mod16(int a, int b) { return a % b; }
unsigned divu10(unsigned a) { return a / 10; }
long div32(long a, long b) { return a / b; }
unsigned long shl4(unsigned long a) { return a << 4; }
unsigned long shr8(unsigned long a) { return a >> 8; }
