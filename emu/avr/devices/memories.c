// EEPROM and self-programming of flash (data sheet, chapters on AVR memories and boot loader support).

enum { EERIE = 3, EEMPE = 2, EEPE = 1, EERE = 0 };                                            // EECR
enum { SPMIE = 7, RWWSB = 6, SIGRD = 5, RWWSRE = 4, BLBSET = 3, PGWRT = 2, PGERS = 1, SPMEN = 0 }; // SPMCSR
enum { TIMED_WINDOW = 4, EEPROM_CYCLES = 26368, EEPROM_HALF_CYCLES = 14400, PAGE_CYCLES = 36000 };
enum { NRWW_START = 0x7000 };

static void eeprom_write(struct avr *m, u32 value, u64 at)
{
    u32 busy = m->data[EECR] & 1u << EEPE, address = word_at(m, EEARL) & (EEPROM_BYTES - 1);
    u32 mode = value >> 4 & 3;
    if (busy)
        mode = m->data[EECR] >> 4 & 3; // the mode cannot change while a write runs
    m->data[EECR] = (u8)(busy | mode << 4 | (value & (1u << EERIE)));
    if (at <= m->eeprom_window && value >> EEPE & 1 && !busy && !bit_of(m, SPMCSR, SPMEN)) {
        u8 *cell = m->eeprom + address;
        *cell = mode == 0 ? m->data[EEDR] : mode == 1 ? 0xFF : *cell & m->data[EEDR];
        set_bit(m, EECR, EEPE, 1);
        schedule(m, EVENT_EEPROM_DONE, at + (mode == 0 ? EEPROM_CYCLES : EEPROM_HALF_CYCLES));
        m->eeprom_window = 0;
        m->cycle += 2; // the CPU is halted
        return;
    }
    if (value >> EEMPE & 1)
        m->eeprom_window = at + TIMED_WINDOW;
    if (value >> EERE & 1 && !busy) {
        m->data[EEDR] = m->eeprom[address];
        m->cycle += 4; // the CPU is halted
    }
}

static u32 eeprom_read_control(const struct avr *m)
{
    u32 armed = m->eeprom_window && m->cycle <= m->eeprom_window;
    return m->data[EECR] | armed << EEMPE;
}

static void eeprom_done(struct avr *m)
{
    m->due[EVENT_EEPROM_DONE] = NEVER;
    set_bit(m, EECR, EEPE, 0);
}

static void spm_write(struct avr *m, u32 value, u64 at)
{
    u32 busy = m->due[EVENT_FLASH_DONE] != NEVER;
    if (busy) {
        m->data[SPMCSR] = (u8)((m->data[SPMCSR] & 0x7F) | (value & 1u << SPMIE));
        return;
    }
    m->data[SPMCSR] = (u8)((value & 0xBF) | (m->data[SPMCSR] & 1u << RWWSB));
    m->spm_window = value >> SPMEN & 1 ? at + TIMED_WINDOW : 0;
}

static u32 spm_read(const struct avr *m)
{
    u32 active = m->due[EVENT_FLASH_DONE] != NEVER || (m->spm_window && m->cycle <= m->spm_window);
    return active ? m->data[SPMCSR] : m->data[SPMCSR] & ~0x3Fu;
}

static void erase_page_buffer(struct avr *m)
{
    for (u32 n = 0; n < PAGE_BYTES; n++)
        m->page[n] = 0xFF, m->spm_latched[n] = 0;
}

// Execute SPM at word address `pc`. Outside the boot section it has no effect.
static void program_flash(struct avr *m, u32 pc)
{
    u32 command = m->data[SPMCSR] & 0x3F, z = word_at(m, 30), start = z & (FLASH_BYTES - PAGE_BYTES);
    if (pc < m->boot_start || !m->spm_window || m->cycle > m->spm_window || m->due[EVENT_FLASH_DONE] != NEVER)
        return;
    m->spm_window = 0;
    if (command == 1u << SPMEN) {
        u32 at = z & (PAGE_BYTES - 2);
        if (!m->spm_latched[at])
            m->page[at] = m->data[0], m->page[at + 1] = m->data[1], m->spm_latched[at] = 1;
    } else if (command == (1u << SPMEN | 1u << RWWSRE)) {
        m->data[SPMCSR] &= (u8) ~(1u << RWWSB);
        erase_page_buffer(m);
    } else if (command == (1u << SPMEN | 1u << PGERS) || command == (1u << SPMEN | 1u << PGWRT)) {
        for (u32 n = 0; n < PAGE_BYTES; n++)
            m->flash[start + n] = command >> PGERS & 1 ? 0xFF : m->flash[start + n] & m->page[n];
        if (command >> PGWRT & 1)
            erase_page_buffer(m);
        m->program_changed = 1;
        m->deadline = 0;
        if (start >= NRWW_START) {
            m->stalled_until = m->cycle + 1 + PAGE_CYCLES; // the CPU is halted
        } else {
            m->data[SPMCSR] |= 1u << RWWSB;
            schedule(m, EVENT_FLASH_DONE, m->cycle + 1 + PAGE_CYCLES);
            return;
        }
    }
    m->data[SPMCSR] &= 0xC0;
}

static void flash_done(struct avr *m)
{
    m->due[EVENT_FLASH_DONE] = NEVER;
    m->data[SPMCSR] &= 0xC0;
}

// Return the byte that LPM reads while SPMCSR selects the signature row or the lock and fuse bits.
static u32 special_row(struct avr *m, u32 z)
{
    static const u8 signature[] = {0x1E, 0xFF, 0x95, 0xFF, 0x0F};
    u32 command = m->data[SPMCSR];
    m->data[SPMCSR] &= 0xC0;
    m->spm_window = 0;
    if (command >> SIGRD & 1)
        return z < 5 && !(z & 1) ? signature[z] : z == 1 ? m->data[OSCCAL] : 0xFF;
    return 0xFF;
}
