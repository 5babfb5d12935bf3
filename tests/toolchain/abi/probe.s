; What assembly sees of calls made by C, and calls of C made by assembly (abi-elf.md §2).
	.section .nbss.probe,bss,near
	.global _probe_regs
	.global _probe_stack
	.global _probe_result
_probe_regs:
	.space 16
_probe_stack:
	.space 20
_probe_result:
	.space 8

	.section .text.probe,code
; Record W0-W7 and the ten words below the return address; answer with probe_result in W0-W3.
	.global _probe
_probe:
	mov w0,_probe_regs
	mov w1,_probe_regs+2
	mov w2,_probe_regs+4
	mov w3,_probe_regs+6
	mov w4,_probe_regs+8
	mov w5,_probe_regs+10
	mov w6,_probe_regs+12
	mov w7,_probe_regs+14
	sub w15,#6,w1
	mov #_probe_stack,w2
	repeat #9
	mov [w1--],[w2++]
	mov _probe_result,w0
	mov _probe_result+2,w1
	mov _probe_result+4,w2
	mov _probe_result+6,w3
	return

; int c_mixed(int a, long b, int c, long d, int e, int f, int g): a W0, b W2:W3, c W1, d W4:W5, e W6, f W7, g stack
	.global _call_mixed
_call_mixed:
	mov #0x7777,w0
	mov w0,[w15++]
	mov #0x1111,w0
	mov #0x2222,w2
	mov #0x3333,w3
	mov #0x4444,w1
	mov #0x5555,w4
	mov #0x6666,w5
	mov #0x0E0E,w6
	mov #0x0F0F,w7
	rcall _c_mixed
	dec2 w15,w15
	return

; int c_chars(signed char a, unsigned char b, _Bool c): upper bytes are undefined
	.global _call_chars
_call_chars:
	mov #0xA5FE,w0
	mov #0x5AC8,w1
	mov #0xFF01,w2
	bra _c_chars

; int c_variadic(int n, ...) with 2, 0x1234, 0x55556666L, then n last
	.global _call_variadic
_call_variadic:
	mov #0x6666,w0
	mov w0,[w15++]
	mov #0x5555,w0
	mov w0,[w15++]
	mov #0x1234,w0
	mov w0,[w15++]
	mov #2,w0
	mov w0,[w15++]
	rcall _c_variadic
	sub w15,#8,w15
	return

; int c_struct(struct pair p in W0:W1, struct odd q in W2:W3, int r in W4): word 0x0201, 0x..03
	.global _call_struct
_call_struct:
	mov #0x1111,w0
	mov #0x2222,w1
	mov #0x0201,w2
	mov #0xEE03,w3
	mov #0x4444,w4
	bra _c_struct

; W8-W14 and the stack survive a call of C: returns 0
	.global _call_preserved
_call_preserved:
	mov.d w8,[w15++]
	mov.d w10,[w15++]
	mov.d w12,[w15++]
	mov w14,[w15++]
	mov #0x0808,w8
	mov #0x0909,w9
	mov #0x0A0A,w10
	mov #0x0B0B,w11
	mov #0x0C0C,w12
	mov #0x0D0D,w13
	mov #0x0E0E,w14
	mov w15,_probe_result
	rcall _c_busy
	mov _probe_result,w0
	xor w0,w15,w0
	mov #0x0808,w1
	xor w1,w8,w1
	ior w0,w1,w0
	mov #0x0909,w1
	xor w1,w9,w1
	ior w0,w1,w0
	mov #0x0A0A,w1
	xor w1,w10,w1
	ior w0,w1,w0
	mov #0x0B0B,w1
	xor w1,w11,w1
	ior w0,w1,w0
	mov #0x0C0C,w1
	xor w1,w12,w1
	ior w0,w1,w0
	mov #0x0D0D,w1
	xor w1,w13,w1
	ior w0,w1,w0
	mov #0x0E0E,w1
	xor w1,w14,w1
	ior w0,w1,w0
	mov [--w15],w14
	mov.d [--w15],w12
	mov.d [--w15],w10
	mov.d [--w15],w8
	return
