"""The pictures of the documentation: `python -m tests.draw.pictures` makes them in docs/images anew."""

import tempfile
from pathlib import Path

from tests.cli.running import EXAMPLES, REPOSITORY, command, example
from tests.draw.browser import browser, settle

IMAGES = REPOSITORY / "docs" / "images"
KITCHEN = EXAMPLES / "kitchen" / "kitchen.tpnu.json"
NORMAL = ("--distribution", "to_ridge=normal::5", "--distribution", "to_crater=normal::5")
COFFEE = ("--parameter", "coffee=duration:make-coffee", "--parameter", "limit=at-most:e1:e44")
ROVER = REPOSITORY / "benchmarks" / "domains" / "solar_rover"
YIELD = (ROVER / "domain-yield.pddl", ROVER / "problem-yield.pddl", ROVER / "plan-yield.stn")
PICTURES = {
    "navigation-envelope.svg": ("envelope", *example(), "--plot"),
    "navigation-compare.svg": ("compare", *example(), "--plot"),
    "controllability.svg": ("envelope", *YIELD, "--plot"),
    "navigation-risk.svg": ("risk", *example(), *NORMAL, "--plot"),
    "navigation-repair.svg": ("region", *example("plan-flexible-wait.stn"), "--plot"),
    "breakfast.svg": ("pike", "region", KITCHEN, *COFFEE, "--plot"),
}
"""Each with the command that draws it, but for the file."""
DAY = "".join(
    f'[[draw]]\nparameter = "{name}"\ndistribution = "constant"\nvalue = {value}\n'
    for name, value in {"to_ridge": 22, "to_crater": 49}.items()
)
"""The world of an execution that leaves its box and goes on."""


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        world = Path(folder) / "world.toml"
        world.write_text(DAY, encoding="utf-8")
        left = ("execute", *example(), "--world", world, "--executor", "slice:60", "--plot")
        for name, asked in {**PICTURES, "what-is-left.svg": left}.items():
            done = command(*asked, IMAGES / name)
            assert done.code == 0, done.err
        page = Path(folder) / "page.html"
        assert command("compare", *example(), "--html", page).code == 0
        with browser(width=1100) as window:
            window.get(page.as_uri())
            field = "document.getElementById('value-0')"
            window.execute_script(f"{field}.value = '47'; {field}.dispatchEvent(new Event('input'))")
            settle(window)
            size = {"width": 1100, "height": 940, "deviceScaleFactor": 1, "mobile": False}
            window.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
            settle(window)
            window.save_screenshot(str(IMAGES / "compare-page.png"))


if __name__ == "__main__":
    main()
