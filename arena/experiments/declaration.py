"""Declarations of experiments in records: names, labels, units and scales of curves and measures, without code.

A record of a user's experiment stores the declaration in its metadata, and the curves as columns `c_NAME`. Commands
show the record without running the experiment's code. Measures that the file defines need the code, and so do groups
of objects.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, Final, NoReturn

from arena.experiments import Curve, Experiment, Measure, TrialSamples, default_measure
from arena.scene.loader import SceneError

CURVE_COLUMN: Final = "c_"
"""Prefix of the columns with the values of curves."""
SHAPE: Final = {
    "published": str,
    "curves": [{"name": str, "label": str, "unit": str, "scale": float, "best?": float, "reference?": (float, str)}],
    "measures?": [{"name": str, "label": str}],
}
"""JSON shape of a declaration. `measures` is null for the default measures."""
_TIME_FIELD: Final = re.compile(r"\{\{(at(?::[.0-9]{0,3}[efg])?)\}\}")


def declaration_of(experiment: Experiment) -> dict[str, Any]:
    """Return the declaration of an experiment as a JSON value. Raises SceneError for values of a wrong type."""
    try:
        curves = [
            {"name": str(one.name), "label": str(one.label), "unit": str(one.unit), "scale": float(one.scale),
             "best": None if one.best is None else float(one.best),
             "reference": None if one.reference is None else [float(one.reference[0]), str(one.reference[1])]}
            for one in experiment.curves
        ]  # fmt: skip
        measures = [{"name": str(one.name), "label": str(one.label)} for one in experiment.measures]
    except (TypeError, ValueError, LookupError, AttributeError) as error:
        raise SceneError(f"experiment {experiment.name}: CURVES or MEASURES: {error}") from None
    return {"published": str(experiment.published), "curves": curves,
            "measures": None if experiment.has_default_measures else measures}  # fmt: skip


def declared_experiment(name: str, declaration: dict[str, Any] | None, columns: Mapping[str, Any]) -> Experiment:
    """Return the experiment that a record declares, with the curves that `columns` hold and without any code.

    The declaration must have the shape `SHAPE`; None stands for a record without a declaration."""
    found = declaration or {"published": "", "curves": [], "measures": []}
    recorded = [one for one in found["curves"] if CURVE_COLUMN + one["name"] in columns]
    return _declared(name, json.dumps(found | {"curves": recorded}, sort_keys=True))


@cache
def _declared(name: str, text: str) -> Experiment:
    """Return a declared experiment; equal declarations give the same object, so two runs of them compare equal."""
    found = json.loads(text)
    curves = tuple(
        Curve(one["name"], one["label"], one["unit"], one["scale"], one.get("best"),
              tuple(one["reference"]) if one.get("reference") else None)
        for one in found["curves"]
    )  # fmt: skip
    own = found.get("measures")
    if own is None and curves:
        measures = tuple(default_measure(curve) for curve in curves)
    else:
        measures = tuple(
            Measure(one["name"], _safe_format(one["label"]), _code_required(name, f"measure {one['name']}"))
            for one in own or [{"name": "", "label": "measures"}]
        )
    return Experiment(name, curves, measures, _no_code(name), found["published"], is_declaration=True)


def code_needed(name: str, what: str) -> SceneError:
    """Return the error for a request, `what`, that needs the code of the experiment called `name`."""
    return SceneError(f"experiment {name}: {what}: needs the experiment's code, which a record does not run: "
                      "name its file with --experiment FILE, or accept the recorded copy with --trust")  # fmt: skip


def _safe_format(label: str) -> str:
    """Return a label for `str.format` in which only the field `at` is replaced: the label comes from a record."""
    return _TIME_FIELD.sub(r"{\1}", label.replace("{", "{{").replace("}", "}}"))


def _code_required(name: str, what: str) -> Callable[..., float]:
    def refuse(*_arguments: Any) -> NoReturn:
        raise code_needed(name, what)

    return refuse


def _no_code(name: str) -> Callable[[TrialSamples], NoReturn]:
    def refuse(_samples: TrialSamples) -> NoReturn:
        raise code_needed(name, "curves")

    return refuse
