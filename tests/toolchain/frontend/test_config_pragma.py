"""Configuration words: XC16's `#pragma config`, the macros of the device header, and wrong settings."""

from __future__ import annotations

from pathlib import Path

import pytest

from emu.chips import chip_named
from emu.image.loader import load_image
from tests.toolchain.c_programs import run
from toolchain.driver import driver
from toolchain.frontend import config_pragma


def test_configuration_pragmas_make_configuration_words(tmp_path: Path) -> None:
    """Configuration pragmas of MPLAB X's code generator create configuration words (dspic30f6014a.md §2)."""
    source = """
    #pragma config FOSFPR = XT_PLL8, FCKSMEN = CSW_FSCM_OFF
    #pragma config FWPSB = WDTB_16
    #pragma config FWPSA = WDTA_64
    #pragma config WDT = WDT_OFF
    #pragma config FPWRT = PWRT_16, BODENV = BORV27, BOREN = PBOR_OFF, MCLRE = MCLR_EN
    #pragma config GWRP = GWRP_OFF, GCP = CODE_PROT_ON
    #pragma config ICS = 1
    int main(void) { return 0; }
    """
    (tmp_path / "main.c").write_text(source)
    assert driver.main([str(tmp_path / "main.c"), "-o", str(tmp_path / "main.elf")]) == 0
    image = load_image(tmp_path / "main.elf")
    set_ = {word.name: image.word(word.address) for word in image.chip.config.values()}
    words = {name: value & 0xFFFF for name, value in set_.items() if value is not None}
    assert words == {"FOSC": 0xFFE6, "FWDT": 0x7FEF, "FBORPOR": 0xFF6E, "FGS": 0xFFFD, "FICD": 0xFFFD}


def test_protection_of_segments_by_pragmas_and_macros(tmp_path: Path) -> None:
    """Pragmas and macros accept every setting of MPLAB X for this device with its value names (DS70138, section 20)."""
    (tmp_path / "main.c").write_text("""
    #pragma config BODENV = NONE
    #pragma config BWRP = WR_PROTECT_BOOT_OFF, BSS = NO_BOOT_CODE, EBS = SMALL_BOOT_EEPROM, RBS = MED_BOOT_RAM
    #pragma config SWRP = WR_PROT_SEC_OFF, SSS = NO_SEC_CODE, ESS = NO_SEC_EEPROM, RSS = NO_SEC_RAM
    #pragma config GWRP = GWRP_OFF, GCP = GSS_OFF
    #pragma config ICS = ICS_PGD2
    int main(void) { return 0; }
    """)
    (tmp_path / "macros.c").write_text("""
    #include <p30F6014A.h>
    _FBORPOR(PBOR_OFF); _FBS(WR_PROTECT_BOOT_ON & STRD_MEDIUM_BOOT_CODE & NO_BOOT_EEPROM & LARGE_BOOT_RAM);
    _FSS(WR_PROT_SEC_ON & HIGH_LARGE_SEC_CODE & MED_SEC_EEPROM & SMALL_SEC_RAM); _FGS(GSS_HIGH); _FICD(PGD3);
    enum { NONE } left_to_the_program;
    int main(void) { return 0; }
    """)
    wanted = {
        "main": {"FBORPOR": 0xFFFF, "FBS": 0xDEFF, "FSS": 0xFFFF, "FGS": 0xFFFF, "FICD": 0xFFFD},
        "macros": {"FBORPOR": 0xFF7F, "FBS": 0xCFFA, "FSS": 0xEDF0, "FGS": 0xFFFB, "FICD": 0xFFFC},
    }
    for name, words in wanted.items():
        assert driver.main([str(tmp_path / f"{name}.c"), "-o", str(tmp_path / f"{name}.elf")]) == 0
        image = load_image(tmp_path / f"{name}.elf")
        found = {word.name: image.word(word.address) for word in image.chip.config.values()}
        assert {key: value & 0xFFFF for key, value in found.items() if value is not None} == words


def test_a_wrong_configuration_pragma_names_its_line(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    wrong = "int a;\n#pragma config FPR = XT_PL8\n\n#pragma config FOO = 1\n"
    (tmp_path / "main.c").write_text(wrong + "int main(void) { return 0; }\n")
    assert driver.main([str(tmp_path / "main.c"), "-o", str(tmp_path / "main.elf")]) == 2
    said = capfd.readouterr().err
    assert "main.c:2: error: #pragma config: 'XT_PL8' is not a value of FPR (did you mean XT_PLL8" in said
    assert "main.c:4: error: #pragma config: no setting 'FOO' on this device" in said
    assert not (tmp_path / "main.elf").exists()


def test_a_setting_made_twice_is_refused_unless_it_is_the_same(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two different values of one setting are an error, because the result would depend on their order; equal ones
    are not."""
    main = tmp_path / "main.c"
    twice = "#pragma config WDT = WDT_OFF\n#pragma config WDT = {}, GWRP = GWRP_OFF\nint main(void) {{ return 0; }}\n"
    main.write_text(twice.format("WDT_ON"))
    assert driver.main([str(main)]) == 2
    said = capsys.readouterr().err
    assert "main.c:2: error: #pragma config WDT = WDT_ON, but WDT = WDT_OFF at" in said
    assert "main.c:1" in said
    main.write_text(twice.format("WDT_OFF"))
    assert driver.main([str(main), "-o", str(tmp_path / "main.elf")]) == 0


def test_every_value_macro_of_the_header_changes_one_word() -> None:
    """Each value macro of the header changes one setting of one word: only bits of that setting are 0 in it."""
    masks = [mask for _, mask in config_pragma.settings(chip_named()).values()]
    for name, value in config_pragma.values().items():
        assert any((value | mask) & 0xFFFF == 0xFFFF for mask in [*masks, 0xC71F, 0x803F]), name


def test_a_macro_called_like_a_configuration_word(tmp_path: Path) -> None:
    """A program's macro may have the name of a configuration word (`#define FOSC 7372800`)."""
    source = """
    #include <p30F6014A.h>
    #define FOSC 7.3728e6
    #define FWDT
    _FOSC(CSW_FSCM_OFF & XT_PLL8);
    _FWDT(WDT_OFF)
    int main(void) { return FOSC == 7.3728e6 ? 0 : 1; }
    """
    (tmp_path / "main.c").write_text(source)
    assert driver.main([str(tmp_path / "main.c"), "-o", str(tmp_path / "main.elf")]) == 0
    assert run(tmp_path / "main.elf").status == 0
    image = load_image(tmp_path / "main.elf")
    words = {word.name: image.word(word.address) for word in image.chip.config.values()}
    assert ((words["FOSC"] or 0) & 0xFFFF, (words["FWDT"] or 0) & 0xFFFF) == (0xFFE6, 0x7FFF)
