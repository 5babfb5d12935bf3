/* SPDX-License-Identifier: MIT */
/* Microchip's DSP library for the dsPIC30F: its names, types and Q15 results (16-bit Language Tools Libraries, DS51456).
 * Not included: DCT, DCTIP, CosFactorInit. Every function uses signed fractions, saturating stores, accumulators
 * saturated at 9.31 and convergent rounding; it restores CORCON, PSVPAG and MODCON and leaves the accumulators changed.
 * Vectors have 1 element or more. Comments name the required memory, X or Y: MAC reads 0 from the other one (isa.md §1.2).
 * Cycles: toolchain/runtime/dsp.md. */
#ifndef DSP_H
#define DSP_H

#ifdef __cplusplus
extern "C" {
#endif

typedef int fractional; /* Q15: -1 to 1 - 2^-15 */

typedef struct {
  fractional real;
  fractional imag;
} fractcomplex;

#define Q15(x) ((x) < 0.0 ? (int)(32768 * (x) - 0.5) : (int)(32767 * (x) + 0.5))
#define PI 3.14159265358979323846
#define COEFFS_IN_DATA 0xFF00 /* as page number: the coefficients are in X RAM */

/* Vectors; dst may be a source. */
fractional *VectorCopy(int n, fractional *dst, fractional *src);
fractional *VectorZeroPad(int n, int zeros, fractional *dst, fractional *src); /* dst has n + zeros elements */
fractional *VectorNegate(int n, fractional *dst, fractional *src);
fractional *VectorScale(int n, fractional *dst, fractional *src, fractional factor);
fractional *VectorAdd(int n, fractional *dst, fractional *a, fractional *b);
fractional *VectorSubtract(int n, fractional *dst, fractional *a, fractional *b);
fractional *VectorMultiply(int n, fractional *dst, fractional *a, fractional *b);
fractional VectorDotProduct(int n, fractional *a, fractional *b);
fractional VectorPower(int n, fractional *src);
fractional VectorMax(int n, fractional *src, int *index); /* index of the last of equal elements */
fractional VectorMin(int n, fractional *src, int *index);
fractional *VectorConvolve(int n, int m, fractional *dst, fractional *x, fractional *h); /* m <= n; dst has n + m - 1 */
fractional *VectorCorrelate(int n, int m, fractional *dst, fractional *x, fractional *y);
fractional *VectorWindow(int n, fractional *dst, fractional *src, fractional *window);

/* Windows, computed in floating point. */
fractional *BartlettInit(int n, fractional *window);
fractional *BlackmanInit(int n, fractional *window);
fractional *HammingInit(int n, fractional *window);
fractional *HanningInit(int n, fractional *window);
fractional *KaiserInit(int n, fractional *window, float beta);

/* Matrices, row after row. */
fractional *MatrixAdd(int rows, int columns, fractional *dst, fractional *a, fractional *b);
fractional *MatrixSubtract(int rows, int columns, fractional *dst, fractional *a, fractional *b);
fractional *MatrixScale(int rows, int columns, fractional *dst, fractional *src, fractional factor);
fractional *MatrixMultiply(int rows, int inner, int columns, fractional *dst, fractional *a, fractional *b); /* dst: not a or b */
fractional *MatrixTranspose(int rows, int columns, fractional *dst, fractional *src);
/* Gauss-Jordan with full pivoting; the last three are n elements of work space. NULL if the matrix is singular. */
float *MatrixInvert(int n, float *dst, float *src, float *pivotFlag, int *swappedRows, int *swappedCols);

/* FIR filters. Coefficients are in X RAM, or in program memory with base __builtin_psvoffset() and page
 * __builtin_psvpage(). The delay is in Y RAM, aligned to a power of 2 of at least its size in bytes. */
typedef struct {
  int numCoeffs;
  fractional *coeffsBase;
  fractional *coeffsEnd;
  int coeffsPage;
  fractional *delayBase;
  fractional *delayEnd;
  fractional *delay;
} FIRStruct;

void FIRStructInit(FIRStruct *filter, int numCoeffs, fractional *coeffsBase, int coeffsPage, fractional *delayBase);
void FIRDelayInit(FIRStruct *filter);
void FIRInterpDelayInit(FIRStruct *filter, int rate);
fractional *FIR(int n, fractional *dst, fractional *src, FIRStruct *filter);
fractional *FIRDecimate(int n, fractional *dst, fractional *src, FIRStruct *filter, int rate); /* n outputs */
fractional *FIRInterpolate(int n, fractional *dst, fractional *src, FIRStruct *filter, int rate); /* n inputs */
fractional *FIRLattice(int n, fractional *dst, fractional *src, FIRStruct *filter);
fractional *FIRLMS(int n, fractional *dst, fractional *src, FIRStruct *filter, fractional *reference, fractional mu);
fractional *FIRLMSNorm(int n, fractional *dst, fractional *src, FIRStruct *filter, fractional *reference, fractional mu,
                       fractional *energy);

/* IIR filters of second-order sections, coefficients halved; delays in Y RAM. */
typedef struct {
  int numSectionsLess1;
  fractional *coeffsBase; /* {a2, a1, b2, b1, b0} per section */
  int coeffsPage;
  fractional *delayBase; /* 2 words per section */
  int initialGain;
  int finalShift; /* number of bits, to the left */
} IIRCanonicStruct;

typedef struct {
  int numSectionsLess1;
  fractional *coeffsBase; /* {b0, b1, a1, b2, a2} per section */
  int coeffsPage;
  fractional *delayBase1; /* each 1 word per section */
  fractional *delayBase2;
  int finalShift;
} IIRTransposedStruct;

typedef struct {
  int order;
  fractional *kappaVals; /* order values */
  fractional *gammaVals; /* order + 1 values; NULL for a filter without zeros */
  int coeffsPage;
  fractional *delay; /* order + 1 words */
} IIRLatticeStruct;

fractional *IIRCanonic(int n, fractional *dst, fractional *src, IIRCanonicStruct *filter);
fractional *IIRTransposed(int n, fractional *dst, fractional *src, IIRTransposedStruct *filter);
fractional *IIRLattice(int n, fractional *dst, fractional *src, IIRLatticeStruct *filter);
void IIRCanonicInit(IIRCanonicStruct *filter);
void IIRTransposedInit(IIRTransposedStruct *filter);
void IIRLatticeInit(IIRLatticeStruct *filter);

/* Transforms of 2^log2n values in Y RAM, all scaled by 1/2^log2n; components below 0.5 do not overflow. In-place transforms
 * convert natural to bit-reversed order, the inverse one bit-reversed to natural. Factors: X RAM or program memory. */
fractcomplex *TwidFactorInit(int log2n, fractcomplex *factors, int conjugate); /* conjugate: 1 for the inverse; 2^(log2n-1) values */
fractcomplex *BitReverseComplex(int log2n, fractcomplex *data);
fractcomplex *FFTComplex(int log2n, fractcomplex *dst, fractcomplex *src, fractcomplex *factors, int page);
fractcomplex *FFTComplexIP(int log2n, fractcomplex *data, fractcomplex *factors, int page);
fractcomplex *IFFTComplex(int log2n, fractcomplex *dst, fractcomplex *src, fractcomplex *factors, int page);
fractcomplex *IFFTComplexIP(int log2n, fractcomplex *data, fractcomplex *factors, int page);
fractional *SquareMagnitudeCplx(int n, fractcomplex *src, fractional *dst); /* src in Y RAM */

/* PID controller: output += a * e[0] + b * e[1] + c * e[2]. */
typedef struct {
  fractional *abcCoefficients;
  fractional *controlHistory; /* e[0], e[1], e[2] */
  fractional controlOutput;
  fractional measuredOutput;
  fractional controlReference;
} tPID;

void PIDInit(tPID *controller);
fractional *PID(tPID *controller);
void PIDCoeffCalc(fractional *gains, tPID *controller); /* {Kp, Ki, Kd} */

fractional Float2Fract(float x); /* rounded to nearest, saturated */
float Fract2Float(fractional x);

#ifdef __cplusplus
}
#endif

#endif
