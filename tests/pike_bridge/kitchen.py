"""A kitchen to test with: a human takes a mug or a glass and makes food, and a robot pours into what was taken."""

from pathlib import Path

from robust.pike_bridge.builder import act, build, choose, parallel, sequence

DOMAIN, PROBLEM = (
    (Path(__file__).parent / "data" / "kitchen" / f"{name}.pddl").read_text(encoding="utf-8")
    for name in ("domain", "problem")
)


def kitchen():
    taking = {vessel: act(f"(get human {vessel})", "0.5", 2, agent="human") for vessel in ("mug", "glass")}
    pouring = {vessel: act(f"(pour robot {vessel})", 1, 3, agent="robot") for vessel in ("mug", "glass")}
    making = {food: act(f"(make human {food})", 2, 4, agent="human") for food in ("bagel", "cereal")}
    return build(
        "kitchen",
        sequence(
            choose("xA1", taking, controllable=False),
            parallel(choose("xR1", pouring), choose("xA2", making, controllable=False)),
        ),
    )
