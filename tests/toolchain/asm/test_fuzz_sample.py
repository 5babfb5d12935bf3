"""A sample of the mutation campaign `tests/fuzz/compiler/fuzz_asm.py`, which `make campaigns` runs at full length."""

import importlib.util
from pathlib import Path

SCRIPT = Path(__file__).resolve().parents[2] / "fuzz" / "compiler" / "fuzz_asm.py"


def test_mutated_sources_and_objects_give_images_or_clean_errors():
    """Mutated sources and objects give an image or errors with positions, without traceback or hang.

    The sample must contain both images and errors.
    """
    spec = importlib.util.spec_from_file_location("fuzz_asm", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    outcomes = module.campaign(range(20, 420))
    assert set(outcomes) == {"assembly refused", "link refused", "linked", "object linked", "object refused"}
