int values[4];
int *pointer = (int *)0x4001;

int main(void)
{
    values[0] = 1;
    *pointer = values[0];
    return 0;
}
