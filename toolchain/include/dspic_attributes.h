/* SPDX-License-Identifier: MIT */
/* Translation of XC16's attributes (abi-elf.md §1.4, §2.5) to clang's. It acts inside `__attribute__((...))` only, so that
 * programs may use `space` or `interrupt` as names. Attribute NAME is replaced by the macro __dspic_a_NAME, if it exists.
 * Attributes of definitions become annotations, those of declarations sections; toolchain/emit/data.py and isr.py read
 * them. Constants, variables and functions cannot share a section, so counters make section names unique. */
#ifndef DSPIC_ATTRIBUTES_H
#define DSPIC_ATTRIBUTES_H
#pragma GCC system_header

#define __attribute__(list) __attribute__((__dspic_each list))
#define __dspic_each(...) __dspic_1(__VA_ARGS__, ) /* ISO C requires an argument for the dots */
#define __dspic_1(a, ...) __dspic_one(a) __VA_OPT__(, __dspic_2(__VA_ARGS__))
#define __dspic_2(a, ...) __dspic_one(a) __VA_OPT__(, __dspic_3(__VA_ARGS__))
#define __dspic_3(a, ...) __dspic_one(a) __VA_OPT__(, __dspic_4(__VA_ARGS__))
#define __dspic_4(a, ...) __dspic_one(a) __VA_OPT__(, __dspic_5(__VA_ARGS__))
#define __dspic_5(a, ...) __dspic_one(a) __VA_OPT__(, __dspic_6(__VA_ARGS__))
#define __dspic_6(a, ...) __dspic_one(a) __VA_OPT__(, __VA_ARGS__)
#define __dspic_one(a) __dspic_pick(__dspic_a_##a, (a))
/* A mapped attribute expands to `~, (replacement)`: the second argument is the replacement, else the attribute itself. */
#define __dspic_pick(...) __dspic_second(__VA_ARGS__, )
#define __dspic_second(first, second, ...) __dspic_open second
#define __dspic_open(...) __VA_ARGS__
#define __dspic_text(x) #x
#define __dspic_number(x) __dspic_text(x)

/* `interrupt`, or `interrupt(irq(N), save(a, b), preprologue("text"))`: before a parenthesis the last word is a macro. */
#define __dspic_a_interrupt ~, (__annotate__("interrupt"), __used__)
#define __used__(...) __used__, __dspic_i1(__VA_ARGS__, )
#define __dspic_i1(a, ...) __dspic_i_##a __VA_OPT__(, __dspic_i2(__VA_ARGS__))
#define __dspic_i2(a, ...) __dspic_i_##a __VA_OPT__(, __dspic_i3(__VA_ARGS__))
#define __dspic_i3(a, ...) __dspic_i_##a __VA_OPT__(, __dspic_i4(__VA_ARGS__))
#define __dspic_i4(a, ...) __dspic_i_##a
#define __dspic_i_irq(number) __annotate__("irq:" __dspic_number(number))
#define __dspic_i_altirq(number) __annotate__("altirq:" __dspic_number(number))
#define __dspic_i_save(...) __annotate__("save:" #__VA_ARGS__)
#define __dspic_i_preprologue(text) __annotate__("preprologue:" text)
#define __dspic_i_shadow __annotate__("shadow")
#define __dspic_i_auto_psv __annotate__("auto_psv")
#define __dspic_i_no_auto_psv __annotate__("no_auto_psv")
#define __dspic_i___irq__ __dspic_i_irq
#define __dspic_i___altirq__ __dspic_i_altirq
#define __dspic_i___save__ __dspic_i_save
#define __dspic_i___preprologue__ __dspic_i_preprologue
#define __dspic_i___shadow__ __dspic_i_shadow
#define __dspic_a_auto_psv ~, (__annotate__("auto_psv"))
#define __dspic_a_no_auto_psv ~, (__annotate__("no_auto_psv"))
#define __dspic_a_shadow ~, (__annotate__("shadow"))
#define __dspic_a_near ~, (__section__(".near." __dspic_number(__COUNTER__)))
#define __dspic_a_far ~, (__section__(".far." __dspic_number(__COUNTER__)))
#define __dspic_a_persistent ~, (__section__(".pbss"))
#define __dspic_a_noload ~, (__annotate__("noload"))
#define __dspic_a_address(number) ~, (__used__, __annotate__("address(" __dspic_text(number) ")"))
#define __dspic_a_keep ~, (__used__, __retain__)
#define __dspic_a_reverse(number) ~, (__annotate__("reverse(" __dspic_text(number) ")"))
#define __dspic_a_user_init ~, (__constructor__)
#define __dspic_a_unordered ~, () /* position in the section, which the linker chooses in any case */
/* Attributes of other chips and unsupported ones would change the placement, so they are errors, not warnings. */
#define __dspic_refused(text) __aligned__(sizeof(struct { int i; _Static_assert(0, text " is not supported"); }))
#define __unused__(...) __unused__ /* discards an argument list, like `__used__` above */
#define __dspic_a_sfr ~, (__dspic_refused("attribute sfr"), __unused__)
#define __dspic_a_boot ~, (__dspic_refused("attribute boot"), __unused__)
#define __dspic_a_secure ~, (__dspic_refused("attribute secure"), __unused__)
#define __dspic_a_eds ~, (__dspic_refused("attribute eds"), __unused__)
#define __dspic_a_space(kind) ~, (__dspic_space(__dspic_s_##kind, (__dspic_refused("attribute space(" #kind ")"))))
#define __dspic_space(...) __dspic_space_second(__VA_ARGS__, )
#define __dspic_space_second(first, second, ...) __dspic_space_open second
#define __dspic_space_open(...) __VA_ARGS__

#define __dspic_s_data ~, ()
#define __dspic_s_auto_psv ~, ()
#define __dspic_s_prog ~, (__section__(".prog." __dspic_number(__COUNTER__)))
#define __dspic_s_psv ~, (__section__(".psv." __dspic_number(__COUNTER__)))
#define __dspic_s_eedata ~, (__used__, __section__(".eedata." __dspic_number(__COUNTER__)))
#define __dspic_s_xmemory ~, (__section__(".xmemory." __dspic_number(__COUNTER__)))
#define __dspic_s_ymemory ~, (__section__(".ymemory." __dspic_number(__COUNTER__)))

#define __dspic_s___data__ __dspic_s_data
#define __dspic_s___auto_psv__ __dspic_s_auto_psv
#define __dspic_s___prog__ __dspic_s_prog
#define __dspic_s___psv__ __dspic_s_psv
#define __dspic_s___eedata__ __dspic_s_eedata
#define __dspic_s___xmemory__ __dspic_s_xmemory
#define __dspic_s___ymemory__ __dspic_s_ymemory

#define __dspic_a___interrupt__ __dspic_a_interrupt
#define __dspic_a___auto_psv__ __dspic_a_auto_psv
#define __dspic_a___no_auto_psv__ __dspic_a_no_auto_psv
#define __dspic_a___shadow__ __dspic_a_shadow
#define __dspic_a___near__ __dspic_a_near
#define __dspic_a___far__ __dspic_a_far
#define __dspic_a___persistent__ __dspic_a_persistent
#define __dspic_a___noload__ __dspic_a_noload
#define __dspic_a___address__ __dspic_a_address
#define __dspic_a___keep__ __dspic_a_keep
#define __dspic_a___reverse__ __dspic_a_reverse
#define __dspic_a___user_init__ __dspic_a_user_init
#define __dspic_a___unordered__ __dspic_a_unordered
#define __dspic_a___space__ __dspic_a_space
#define __dspic_a___sfr__ __dspic_a_sfr
#define __dspic_a___boot__ __dspic_a_boot
#define __dspic_a___secure__ __dspic_a_secure
#define __dspic_a___eds__ __dspic_a_eds

#endif
