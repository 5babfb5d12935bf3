/* SPDX-License-Identifier: MIT */
/* Microchip's fixed-point library by its names (16-Bit Language Tools Libraries, DS51456).
 *
 * _Q15 has a sign and 15 fraction bits, _Q16 a sign, 15 integer bits and 16 fraction bits. Results are rounded to the
 * nearest value and saturate. Angles are in radians; functions that end in PI take an angle divided by pi, those that end
 * in ByPI return one. Functions ending in NoSat wrap around and set a flag, which the program clears. */
#ifndef LIBQ_H
#define LIBQ_H

#ifdef __cplusplus
extern "C" {
#endif

typedef short _Q0_15;
typedef long _Q15_16;
typedef _Q0_15 _Q15;
typedef _Q15_16 _Q16;

extern short _Q15randomSeed;
extern long _Q16randomSeed;
extern short _Q15shlSatFlag, _Q15shrSatFlag, _Q16shlSatFlag, _Q16shrSatFlag, _Q16macSatFlag;

_Q15 _Q15abs(_Q15 x);
_Q15 _Q15neg(_Q15 x);
_Q15 _Q15add(_Q15 x, _Q15 y);
_Q15 _Q15sub(_Q15 x, _Q15 y);
/* Shifts: a negative distance shifts into the other direction; shifts to the right round down. */
_Q15 _Q15shl(_Q15 x, short distance);
_Q15 _Q15shr(_Q15 x, short distance);
_Q15 _Q15shlNoSat(_Q15 x, short distance);
_Q15 _Q15shrNoSat(_Q15 x, short distance);
_Q15 _Q15norm(_Q15 x); /* x shifted left until the sign bit and the bit below it differ */
_Q15 _Q15sqrt(_Q15 x);
_Q15 _Q15exp(_Q15 x);
_Q15 _Q15log(_Q15 x);
_Q15 _Q15log10(_Q15 x);
_Q15 _Q15power(_Q15 x, _Q15 y);
_Q15 _Q15sin(_Q15 x);
_Q15 _Q15sinPI(_Q15 x);
_Q15 _Q15cos(_Q15 x);
_Q15 _Q15cosPI(_Q15 x);
_Q15 _Q15tan(_Q15 x);
_Q15 _Q15tanPI(_Q15 x);
_Q15 _Q15asin(_Q15 x);
_Q15 _Q15asinByPI(_Q15 x);
_Q15 _Q15acos(_Q15 x);
_Q15 _Q15acosByPI(_Q15 x);
_Q15 _Q15atan(_Q15 x);
_Q15 _Q15atanByPI(_Q15 x);
_Q15 _Q15atanYByX(_Q15 x, _Q15 y);
_Q15 _Q15atanYByXByPI(_Q15 x, _Q15 y);
_Q15 _Q15random(void);
_Q15 _Q15ftoi(float x);
float _itofQ15(_Q15 x);
_Q15 _Q15atoi(const unsigned char *text);
void _itoaQ15(_Q15 x, unsigned char *text); /* sign, "0." and 15 digits at most: 19 bytes */

_Q16 _Q16neg(_Q16 x);
_Q16 _IQ16mpy(_Q16 x, _Q16 y);
#define _Q16mpy _IQ16mpy
_Q16 _Q16div(_Q16 x, _Q16 y); /* the largest value of the sign of x, if y is 0 */
_Q16 _Q16divmod(_Q16 x, _Q16 y, _Q16 *remainder);
_Q16 _Q16mac(_Q16 x, _Q16 y, _Q16 sum);
_Q16 _Q16macNoSat(_Q16 x, _Q16 y, _Q16 sum);
_Q16 _Q16shl(_Q16 x, short distance);
_Q16 _Q16shr(_Q16 x, short distance);
_Q16 _Q16shlNoSat(_Q16 x, short distance);
_Q16 _Q16shrNoSat(_Q16 x, short distance);
_Q16 _Q16norm(_Q16 x);
_Q16 _Q16reciprocalQ15(_Q15 x);
_Q16 _Q16reciprocalQ16(_Q16 x);
_Q16 _Q16exp(_Q16 x);
_Q16 _Q16log(_Q16 x);
_Q16 _Q16log10(_Q16 x);
_Q16 _Q16power(_Q16 x, _Q16 y);
_Q16 _Q16sin(_Q16 x);
_Q16 _Q16sinPI(_Q16 x);
_Q16 _Q16cos(_Q16 x);
_Q16 _Q16cosPI(_Q16 x);
_Q16 _Q16tan(_Q16 x);
_Q16 _Q16tanPI(_Q16 x);
_Q16 _Q16asin(_Q16 x);
_Q16 _Q16asinByPI(_Q16 x);
_Q16 _Q16acos(_Q16 x);
_Q16 _Q16acosByPI(_Q16 x);
_Q16 _Q16atan(_Q16 x);
_Q16 _Q16atanByPI(_Q16 x);
_Q16 _Q16atanYByX(_Q16 x, _Q16 y);
_Q16 _Q16atanYByXByPI(_Q16 x, _Q16 y);
_Q16 _Q16random(void);
_Q16 _Q16ftoi(float x);
float _itofQ16(_Q16 x);

#ifdef __cplusplus
}
#endif

#endif
