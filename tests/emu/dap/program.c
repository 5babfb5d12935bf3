#include <stdio.h>

struct pair {
    int first;
    long second;
};
struct pair pairs[3] = {{1, 10}, {2, 20}, {3, 30}};
volatile int total;

int add(int a, int b)
{
    int sum = a + b;
    total = sum;
    return sum;
}

int twice(int n)
{
    int once = add(n, 0);
    return add(once, n);
}

int main(void)
{
    int i;
    for (i = 0; i < 5; i++) {
        twice(i);
    }
    printf("total %d\n", total);
    for (i = 0; i < 500; i++) {
    }
    pairs[1].second = total;
    return *(volatile int *)(total + 0x3001);
}
