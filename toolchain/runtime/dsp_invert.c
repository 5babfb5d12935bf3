/* SPDX-License-Identifier: MIT */
/* dsp.h: inverse of a matrix, by Gauss-Jordan elimination with full pivoting (Golub and Van Loan, Matrix Computations,
 * section 3.4). The caller provides the work space. */
#include <dsp.h>
#include <math.h>
#include <stddef.h>

static void swap(float *a, float *b)
{
    float kept = *a;
    *a = *b;
    *b = kept;
}

float *MatrixInvert(int n, float *dst, float *src, float *pivotFlag, int *swappedRows, int *swappedCols)
{
    if (dst != src)
        for (int i = 0; i < n * n; i++)
            dst[i] = src[i];
    for (int i = 0; i < n; i++)
        pivotFlag[i] = 0.0f;
    for (int step = 0; step < n; step++) {
        int row = 0, column = 0;
        float best = 0.0f;
        for (int r = 0; r < n; r++)
            for (int c = 0; c < n; c++)
                if (pivotFlag[r] == 0.0f && pivotFlag[c] == 0.0f && fabsf(dst[r * n + c]) > best) {
                    best = fabsf(dst[r * n + c]);
                    row = r;
                    column = c;
                }
        if (best == 0.0f)
            return NULL;
        pivotFlag[column] = 1.0f;
        swappedRows[step] = row;
        swappedCols[step] = column;
        if (row != column)
            for (int c = 0; c < n; c++)
                swap(&dst[row * n + c], &dst[column * n + c]);
        float *pivot = dst + column * n;
        float factor = 1.0f / pivot[column];
        pivot[column] = 1.0f;
        for (int c = 0; c < n; c++)
            pivot[c] *= factor;
        for (int r = 0; r < n; r++) {
            float *line = dst + r * n;
            float times = line[column];
            if (r == column)
                continue;
            line[column] = 0.0f;
            for (int c = 0; c < n; c++)
                line[c] -= times * pivot[c];
        }
    }
    for (int step = n - 1; step >= 0; step--)
        if (swappedRows[step] != swappedCols[step])
            for (int r = 0; r < n; r++)
                swap(&dst[r * n + swappedRows[step]], &dst[r * n + swappedCols[step]]);
    return dst;
}
