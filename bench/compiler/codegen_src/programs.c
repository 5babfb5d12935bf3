/* Larger functions without a vendor figure; sizes and cycles are followed over time. */
#include <stdio.h>

void bubble_sort(int *v, int n)
{
    for (int i = n - 1; i > 0; i--)
        for (int j = 0; j < i; j++)
            if (v[j] > v[j + 1]) {
                int t = v[j];
                v[j] = v[j + 1];
                v[j + 1] = t;
            }
}

void matrix_product(const int (*a)[8], const int (*b)[8], int (*c)[8])
{
    for (int i = 0; i < 8; i++)
        for (int j = 0; j < 8; j++) {
            int sum = 0;
            for (int k = 0; k < 8; k++)
                sum += a[i][k] * b[k][j];
            c[i][j] = sum;
        }
}

long fir32(const long *x, const int *h, int taps)
{
    long sum = 0;
    for (int i = 0; i < taps; i++)
        sum += (x[i] >> 8) * h[i];
    return sum;
}

int format_line(char *to, unsigned id, long value, const char *name)
{
    return snprintf(to, 40, "%u %ld %x %s", id, value, id, name);
}

int state_machine(int state, int input)
{
    switch (state) {
    case 0: return input == 'a' ? 1 : 0;
    case 1: return input == 'b' ? 2 : 0;
    case 2: return input > 10 ? 3 : 2;
    case 3: return input & 1 ? 4 : 5;
    case 4: return 6;
    case 5: return input < 0 ? 7 : 6;
    case 6: return input == state ? 8 : 9;
    case 7: return 0;
    case 8: return input + 1;
    case 9: return input >> 2;
    case 10: return 11;
    case 11: return input ? 0 : 10;
    default: return -1;
    }
}

float float_dot(const float *a, const float *b, int n)
{
    float s = 0;
    for (int i = 0; i < n; i++)
        s += a[i] * b[i];
    return s;
}
