/* Calls every measured function once with fixed arguments; volatile objects keep the calls separate. */
struct node {
    struct node *next;
    int key;
    char tag;
};
int sat(int, int, int), itoa10(unsigned, char *), lt32(long, long), ltu32(unsigned long, unsigned long), eq32(long, long);
int mul16(int, int), div16(int, int), mod16(int, int), state_machine(int, int);
int format_line(char *, unsigned, long, const char *);
unsigned crc16(const unsigned char *, int), divu10(unsigned);
long dot(const int *, const int *, int), add32(long, long), sub32(long, long), neg32(long), shl1(long), sar1(long);
long mulss(int, int), mul32(long, long), div32(long, long), fir32(const long *, const int *, int);
unsigned long shlv32(unsigned long, int), muluu(unsigned, unsigned), shl4(unsigned long), shr8(unsigned long);
struct node *find(struct node *, int);
void bubble_sort(int *, int), matrix_product(const int (*)[8], const int (*)[8], int (*)[8]);
float float_dot(const float *, const float *, int);

static int v[32], w[32], m[3][8][8];
static unsigned char bytes[64];
static char text[40];
static long x[16];
static float f[8], g[8];
static struct node nodes[8];
volatile long sink;

int main(void)
{
    for (int i = 0; i < 32; i++) {
        v[i] = (i * 37) % 101 - 50;
        w[i] = (i * 53) % 97 - 40;
    }
    for (int i = 0; i < 64; i++) {
        bytes[i] = (unsigned char)(i * 29);
        m[0][i / 8][i % 8] = i;
        m[1][i / 8][i % 8] = 64 - i;
    }
    for (int i = 0; i < 16; i++)
        x[i] = i * 70001L - 300000L;
    for (int i = 0; i < 8; i++) {
        f[i] = (float)i * 0.5f;
        g[i] = 3.25f - (float)i;
        nodes[i] = (struct node){i < 7 ? &nodes[i + 1] : 0, i * 3, 'x'};
    }
    sink = sat(v[3], -20, 20);
    sink = (long)crc16(bytes, 64);
    sink = dot(v, w, 32);
    sink = find(nodes, 21)->key;
    sink = itoa10(54321u, text);
    sink = add32(x[1], x[2]) + sub32(x[1], x[2]) + neg32(x[3]) + shl1(x[4]) + sar1(x[5]);
    sink = lt32(x[1], x[2]) + ltu32(3, 5) + eq32(x[1], x[1]);
    sink = (long)shlv32(5, v[1] & 15) + mul16(v[1], v[2]) + mulss(v[3], v[4]) + (long)muluu(60000u, 60001u);
    sink = mul32(x[1], x[2]) + div16(v[5], 7) + mod16(v[6], 7) + (long)divu10(54321u) + div32(x[7], 70000L);
    sink = (long)shl4(12345) + (long)shr8(12345678ul);
    bubble_sort(v, 32);
    matrix_product(m[0], m[1], m[2]);
    sink = fir32(x, w, 16);
    sink = format_line(text, 4711, -123456L, "robot");
    sink = state_machine(6, 3);
    sink = (long)float_dot(f, g, 8);
    return 0;
}
