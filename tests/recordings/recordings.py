"""What every command says, recorded, so that it can be compared after a change of the code behind it.

`record DIR` runs the table of cases and writes one text file for each into DIR: the command lines, their exit codes,
what they print on stdout and stderr, and the files they make. `compare DIR` runs the table again, prints a unified diff
for each case that differs, and ends with 1 if there is one. `list` prints the names, `slow` behind those that take more
than about 1.5 s. `--only PATTERN` (a shell pattern, or a part of the name) selects cases. `--command` names the command
line to run instead of `robust` of this interpreter; with `PYTHONPATH`, that of another checkout:

    PYTHONPATH=../main python -m tests.recordings.recordings compare tests/recordings/data --command 'python -m robust'

Each case runs in a new directory, so that paths are relative and the same everywhere. In it are `examples` and
`domains` (links to robust/examples and benchmarks/domains of `--checkout`), `inputs` (a copy of the directory beside
this file), and `dataset` (a link to ROBUST_DATASET or ../shared/paper-dataset beside the checkout; cases that need it
are left out without it). The terminal has 100 columns; hashes of texts are not fixed, so that what depends on the order
of sets shows.

Numbers of checks, queries and polyhedra, and the order in which parts of a region are found, follow from the models
that a solver happens to find. They are the same in each process, but a change of the order in which formulas are made
changes them, and so do commands that ran before in the same process. `compare --loose` lets these differ.

What varies from run to run is masked by `#`:

- in JSON, numbers below keys that measure: `seconds`, `..._s`, `..._mb`, `bytes`, `stages`, ... (see `MEASURED`). null
  stays null, so whether there is a measurement is compared. JSON is laid out anew: what fits stands on one line;
- in text, numbers with a unit that measures: `0.12 s`, `3 ms`, `88 MiB`, `2017 bytes`, with the blanks before them;
- in cases with `+` (tables of measurements, logs), all numbers of the text, and what lays out tables; the numbers that
  do not vary are in the JSON of the same command;
- the working directory, the checkout, and the version of the program.

Of drawings, certificates, HTML and SMT-LIB, only that they are made and of what kind is compared, of other files the
content. Cases whose answer is not the same in two runs are not in the table; `DROPPED` says which and why.
"""

# ruff: noqa: T201 - a command that prints

from __future__ import annotations

import argparse
import difflib
import fnmatch
import itertools
import json
import logging
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import chdir, redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import Any

from tests.cli import inputs
from tests.cli.bad_inputs import BAD_INPUTS

INPUTS = Path(__file__).parent / "inputs"
CHECKOUT = Path(__file__).resolve().parents[2]
COLUMNS = 100
LIMIT = 900.0
"""Seconds after which a command is killed; no case comes near."""


@dataclass(frozen=True)
class Case:
    """Command lines that run one after the other in one directory, and what is compared of them."""

    name: str
    lines: tuple[str, ...]
    slow: bool = False
    masked: bool = False
    """Whether all numbers of text are masked."""
    files: Mapping[str, str | bytes] = field(default_factory=dict)
    """What is in the directory beside the inputs."""

    @property
    def needs_process(self) -> bool:
        """Whether what it says depends on the process: on stdin, on how long a start takes, on the memory of cvc5."""
        return any(word in line for line in self.lines for word in ("--stdio", "--timeout", "cvc5", "bench", "verify"))

    @property
    def needs_dataset(self) -> bool:
        return any("dataset/" in line for line in self.lines)


# -- the table ---------------------------------------------------------------------------------------------------------


def _files(directory: str, *names: str) -> str:
    return " ".join(f"{directory}/{name}" for name in names)


def _plan(directory: str, plan: str = "plan.stn", variant: str = "", problem: str = "") -> str:
    return _files(directory, f"domain{variant}.pddl", f"problem{problem or variant}.pddl", plan)


_NAVIGATION = "examples/two_sample_navigation"
_DELIVERY = _plan("inputs/delivery")
_ONE_VEHICLE, _TWO_VEHICLES = "-one-vehicle", "-two-vehicles"

PLANS = {
    "NAVIGATION": _plan(_NAVIGATION),
    "FLEXIBLE": _plan(_NAVIGATION, "plan-flexible-wait.stn"),
    "GENERATOR": _plan("examples/generator"),
    "SHIPPED": f"{_plan('examples/delivery')} --parameters examples/delivery/plan.toml",
    "SMALL": _plan("inputs/small"),
    "DELIVERY": f"{_DELIVERY} --parameters inputs/delivery/plan.toml",
    "AUV2": _plan("domains/auv_survey", "one-vehicle-2.stn", problem=_ONE_VEHICLE),
    "AUV4": _plan("domains/auv_survey", "one-vehicle-4.stn", problem=_ONE_VEHICLE),
    "AUV6": _plan("domains/auv_survey", "one-vehicle-6.stn", problem=_ONE_VEHICLE),
    "AUV5": _plan("domains/auv_survey", "two-vehicles-5.stn", problem=_TWO_VEHICLES),
    "POUR2": _plan("domains/generator", "plan-5-2.stn", problem="-5"),
    "POUR4": _plan("domains/generator", "plan-5-4.stn", problem="-5"),
    "PAUSES": _plan("domains/generator", "plan-5-pauses-3.stn", problem="-5"),
    "POUR8": _plan("domains/generator", "plan-8-3.stn", problem="-8"),
    "ROVER2": _plan("domains/solar_rover", "plan-2.stn"),
    "ROVER3": _plan("domains/solar_rover", "plan-3.stn"),
    "ROVER4": _plan("domains/solar_rover", "plan-4.stn"),
    "YIELD": _plan("domains/solar_rover", "plan-yield.stn", "-yield"),
    "ORDER2": _plan("domains/robot_delivery", "one-order-2.stn", problem="-one-order"),
    "ORDER5": _plan("domains/robot_delivery", "one-order-5.stn", problem="-one-order"),
    "MISSING": _plan("domains/robot_delivery", "one-order-missing-edge.stn", problem="-one-order"),
    "PREPARED": _plan("domains/robot_delivery", "one-order-preparation-3.stn", problem="-one-order"),
    "ORDERS10": _plan("domains/robot_delivery", "two-orders-10.stn", problem="-two-orders"),
    "BATTERY": _plan("domains/robot_delivery", "one-order-battery-6.stn", "-battery"),
    "RECORDED1": _files("dataset/auv", "domain.pddl", "mission_10_0_1.pddl", "mission_10_0_1.stn"),
    "RECORDED2": _files("dataset/solar-rover", "domain.pddl", "problem_01.pddl", "plan_01_2.stn"),
}
"""Plans by a word that stands for their files in the table."""

WORDS = {
    **PLANS,
    "STEPS": _plan(_NAVIGATION, "steps.plan"),
    "DELIVERING": _plan("inputs/delivery", "steps.plan"),
    "SHIPPING": _plan("examples/delivery", "steps.plan"),
    "INVALID": f"{_files(_NAVIGATION, 'domain.pddl', 'problem.pddl')} inputs/invalid-steps.plan",
    "UNKNOWN": f"{_files(_NAVIGATION, 'domain.pddl', 'problem.pddl')} inputs/unknown-steps.plan",
    "PROBLEM": _files(_NAVIGATION, "domain.pddl", "problem.pddl"),
    "TO-DELIVER": _files("inputs/delivery", "domain.pddl", "problem.pddl"),
    "PLANNER": "'command:python3 @work@/inputs/planner.py {domain} {problem}'",
    "KITCHEN": "examples/kitchen/kitchen.tpnu.json",
    "WING": "examples/wing/wing.tpnu.json",
    "SAT": "inputs/satisfiable/plan.tpnu.json",
    "UNSAT": "inputs/unsatisfiable/plan.tpnu.json",
}

TABLE = {
    "help": """
        robust                         --help
        short                          -h
        nothing
        version                        --version
        command-{check,envelope,region,compare,convert,certify,verify,execute,demo,pike,bench}   %1 --help
        pike-{check,compile,run,plot}  pike %1 --help
        bench-{recorded,scaling,figure3,figure5,backends,encodings,figure4,conversions}   bench %1 --help
        bench-{table1,table2,figure20a,figure20b,figure21,figure17,figure18}   bench %1 --help
        group-{pike,bench}             %1
        """,
    "check": """
        text-{NAVIGATION,FLEXIBLE,GENERATOR,DELIVERY,YIELD,MISSING}   check %1
        json-{NAVIGATION,FLEXIBLE,GENERATOR,SHIPPED,DELIVERY,AUV2,AUV4,AUV6,AUV5}   check %1 --json
        json-{POUR2,POUR4,PAUSES,POUR8,ROVER2,ROVER3,ROVER4,YIELD}   check %1 --json
        json-{ORDER2,ORDER5,MISSING,PREPARED,ORDERS10,BATTERY,RECORDED1,RECORDED2}   check %1 --json
        all-{relational,positions}-{z3,cvc5}   check FLEXIBLE --all --json --encoding %1 --solver %2
        proved-{relational,positions}-{z3,cvc5}   check NAVIGATION --encoding %1 --solver %2
        positions-{GENERATOR,ROVER2,AUV2,DELIVERY}   check %1 --encoding positions --json
        at-inside         check NAVIGATION --at to_ridge=50 --at to_crater=35
        at-outside        check NAVIGATION --at to_ridge=501/10 --at to_crater=30
        at-range          check NAVIGATION --at to_ridge=30:45 --json
        at-range-too-far  check NAVIGATION --at to_ridge=30:45.001 --json
        at-all            check NAVIGATION --at to_ridge=20:60 --all
        at-all-json       check NAVIGATION --at to_ridge=20:60 --all --json
        at-no-schedule    check NAVIGATION --parameter to_ridge,lb=25 --at to_ridge=20
        at-no-schedule-json   check NAVIGATION --parameter to_ridge,lb=25 --at to_ridge=20 --json
        parameter         check NAVIGATION --parameter 'full=fluent:(charge scout)' --at full=100
        parameters        check NAVIGATION --parameters inputs/parameters.toml --at endurance=100 --at home=20 --json
        epsilon           check DELIVERY --epsilon 1/100 --json
        epsilon-too-large check DELIVERY --epsilon 1/10
        quiet             check FLEXIBLE --quiet
        smt2              check NAVIGATION --smt2 queries --json
        +verbose          check NAVIGATION --verbose
        timeout-{text,--json}   check NAVIGATION --timeout 1e-9 %1
        """,
    "envelope": """
        irr-{relational,positions}-{z3,cvc5}   envelope NAVIGATION --method irr --encoding %1 --solver %2 --json
        widen-relational-{z3,cvc5}   envelope NAVIGATION --method widen --encoding relational --solver %1 --json
        widen-positions-z3   envelope NAVIGATION --method widen --encoding positions --solver z3 --json
        optimal-relational-{z3,cvc5}   envelope NAVIGATION --method optimal --solver %1 --json
        *optimal-positions-{z3,cvc5}   envelope SMALL --method optimal --encoding positions --solver %1 --json
        text-{NAVIGATION,FLEXIBLE,GENERATOR,DELIVERY,MISSING}   envelope %1
        json-{FLEXIBLE,GENERATOR,SHIPPED,DELIVERY,AUV2,AUV4,AUV6,AUV5}   envelope %1 --json
        json-{POUR2,POUR4,PAUSES,POUR8,ROVER2,ROVER3,ROVER4,YIELD}   envelope %1 --json
        json-{ORDER2,ORDER5,MISSING,PREPARED,ORDERS10,BATTERY}   envelope %1 --json
        irr-{GENERATOR,DELIVERY,ROVER2,ORDER2}   envelope %1 --method irr --json
        irr-text          envelope NAVIGATION --method irr
        irr-beta          envelope NAVIGATION --method irr --beta 1/3 --json
        irr-doubling      envelope NAVIGATION --method irr --doubling --json
        irr-order         envelope NAVIGATION --method irr --doubling --order to_crater,to_ridge --json
        recorded1         envelope RECORDED1 --method irr --beta 1 --doubling --json
        recorded2         envelope RECORDED2 --method irr --beta 1 --doubling --order dur_2,dur_1 --json
        recorded-widen-{RECORDED1,RECORDED2}   envelope %1 --json
        widen-order       envelope NAVIGATION --order to_crater,to_ridge --json
        widen-order-part  envelope NAVIGATION --order to_crater
        optimal-{GENERATOR,ORDER2,POUR2}   envelope %1 --method optimal --json
        optimal-text      envelope NAVIGATION --method optimal
        optimal-contain   envelope NAVIGATION --method optimal --contain-nominal --json
        {weak,dynamic,strong}-{NAVIGATION,DELIVERY}   envelope %2 --controllability %1 --json
        {weak,dynamic,strong}-text   envelope DELIVERY --controllability %1
        dynamic-{SHIPPED,ORDER5}   envelope %1 --controllability dynamic --json
        dynamic-irr       envelope NAVIGATION --controllability dynamic --method irr
        parameters        envelope NAVIGATION --parameters inputs/parameters.toml --json
        weights           envelope NAVIGATION --method optimal --parameter to_ridge,weight=5 --json
        bounds            envelope NAVIGATION --parameter to_ridge,lb=28,ub=33,default=29
        fluent            envelope NAVIGATION --parameter 'full=fluent:(charge scout)' --json
        epsilon           envelope NAVIGATION --epsilon 1/10 --json
        quiet             envelope NAVIGATION --quiet
        +verbose          envelope NAVIGATION --verbose
        plot-{svg,png,pdf}   envelope NAVIGATION --plot box.%1
        smt2              envelope NAVIGATION --smt2 queries --json
        timeout-{text,--json}   envelope NAVIGATION --timeout 1e-9 %1
        """,
    "region": """
        {project,z3,cvc5,fourier-motzkin,loos-weispfenning}-{monolithic,partial,full}
                          region NAVIGATION --backend %1 --splitting %2 --json
        generator-{project,fourier-motzkin,loos-weispfenning}   region GENERATOR --backend %1 --json
        *generator-{z3,cvc5}   region GENERATOR --backend %1 --json
        text-{NAVIGATION,GENERATOR,DELIVERY,FLEXIBLE}   region %1
        json-{DELIVERY,SHIPPED,AUV2,AUV4,POUR2,ROVER2,YIELD}   region %1 --json
        json-{ORDER2,ORDER5,MISSING,PREPARED,FLEXIBLE,RECORDED1}   region %1 --json
        form-{union,difference}-{text,--json}   region GENERATOR --form %1 %2
        latex-{NAVIGATION,GENERATOR}   region %1 --latex
        latex-difference  region GENERATOR --latex --form difference
        {learning,no-learning}   region GENERATOR --%1 --splitting partial --json
        *positions        region SMALL --encoding positions --json
        solver            region NAVIGATION --solver cvc5 --json
        parameter         region NAVIGATION --parameter to_crater,lb=35,ub=40
        fluent            region NAVIGATION --parameter 'full=fluent:(charge scout)' --json
        epsilon           region NAVIGATION --epsilon 1/10 --json
        plot-{svg,png,pdf}   region NAVIGATION --plot region.%1
        axes              region NAVIGATION --plot region.svg --axes to_crater --quiet
        axes-two          region DELIVERY --plot region.svg --axes dur_n0,dur_n2
        timeout-{text,--json}   region NAVIGATION --timeout 1e-9 %1
        """,
    "compare": """
        *{NAVIGATION,ORDER2,DELIVERY}-json   compare %1 --json
        *{NAVIGATION,ORDER2,FLEXIBLE}-text   compare %1
        *beta             compare NAVIGATION --beta 1/4 --json
        *positions        compare SMALL --encoding positions --solver cvc5 --json
        *html             compare NAVIGATION --html report.html --quiet
        *plot             compare NAVIGATION --plot plot.svg --axes to_ridge,to_crater --quiet
        *parameter        compare NAVIGATION --parameter to_ridge,lb=28,ub=33
        timeout-{text,--json}   compare NAVIGATION --timeout 1e-9 %1
        """,
    "convert": """
        {causal,esterel}-{STEPS,SHIPPING,DELIVERING}   convert %2 --mode %1
        json-{causal,esterel}-{STEPS,SHIPPING,DELIVERING}   convert %2 --mode %1 --json
        durations-{causal,esterel}   convert STEPS --mode %1 --parametrize duration:drive -o plan.stn
        durations-delivery   convert DELIVERING --parametrize duration:move,weight=2 -o plan.stn --json
        one-duration      convert STEPS --parametrize duration:n2,lb=30,ub=50
        start             convert STEPS --parametrize start:n0
        fluent            convert STEPS --parametrize 'fluent:(charge scout),ub=200' -o plan.stn
        fluent-printed    convert STEPS --parametrize 'fluent:(charge scout),ub=200'
        epsilon           convert DELIVERING --epsilon 1/200
        cvc5              convert STEPS --solver cvc5 --json
        then-envelope     convert STEPS --parametrize duration:drive -o plan.stn --quiet && envelope PROBLEM plan.stn
        invalid-{text,--json}   convert INVALID %1
        unknown-action    convert UNKNOWN
        timeout-{text,--json}   convert STEPS --timeout 1e-9 %1
        """,
    "execute": """
        network-{text,--json}   execute NAVIGATION %1
        steps-{text,--json}   execute STEPS --parametrize duration:drive --world inputs/world.toml --seed 2 %1
        seed-{4,5}        execute STEPS --parametrize duration:drive --world inputs/world.toml --seed %1 --json
        shipped-world     execute STEPS --parametrize duration:drive --world examples/two_sample_navigation/world.toml
        runs-{text,--json}   execute STEPS --parametrize duration:drive --world inputs/world.toml --runs 12 %1
        delivery          execute DELIVERING --parametrize duration:move --json
        blex              execute STEPS --parametrize duration:drive --world inputs/world.toml --executor blex:60 --json
        dynamic           execute NAVIGATION --world inputs/world.toml --controllability dynamic --seed 1
        strong            execute NAVIGATION --world inputs/world.toml --controllability strong --seed 1 --json
        method-{irr,optimal}   execute NAVIGATION --world inputs/world.toml --method %1 --seed 3 --json
        fails-{text,--json}   execute NAVIGATION --world inputs/slow-world.toml %1
        quiet             execute NAVIGATION --quiet
        planner           execute PROBLEM --planner PLANNER --parametrize duration:drive --json
                            --world inputs/world.toml
        no-plan           execute NAVIGATION --planner PLANNER --world inputs/slow-world.toml
        stop-running      execute NAVIGATION --planner PLANNER --world inputs/slow-world.toml --stop-running
                            --planning-time 2 --replans 1 --json
        aries-refused     execute PROBLEM --planner aries
        *aries            execute TO-DELIVER --planner aries --planner-limit 60 --quiet
        *kairos           execute PROBLEM --planner kairos --planner-limit 60 --quiet
        plot-{svg,png,pdf}   execute NAVIGATION --plot run.%1 --quiet
        parameters        execute NAVIGATION --parameters inputs/parameters.toml --quiet
        timeout-{text,--json}   execute NAVIGATION --timeout 1e-9 %1
        no-say            execute STEPS --world inputs/world.toml
        neither           execute PROBLEM
        """,
    "certify": """
        *json-{plan,box,maximal,region}   certify NAVIGATION -o p.cert --kind %1 --json
                            && verify p.cert NAVIGATION --json
        *positions        certify SMALL -o p.cert --encoding positions --json && verify p.cert SMALL --json
        text              certify NAVIGATION -o p.cert && verify p.cert
        *text-maximal     certify SMALL -o p.cert --kind maximal && verify p.cert SMALL
        *generator        certify GENERATOR -o p.cert --json && verify p.cert GENERATOR --json
        *delivery         certify DELIVERY -o p.cert --json && verify p.cert DELIVERY --json
        refuted-{plan,maximal}   certify FLEXIBLE -o p.cert --kind %1
        other-plan        certify NAVIGATION -o p.cert --quiet && verify p.cert FLEXIBLE --json
        other-plan-text   certify NAVIGATION -o p.cert --quiet && verify p.cert FLEXIBLE
        *box-file         certify NAVIGATION -o p.cert --kind box --box inputs/box.json --json
        *box-not-maximal  certify NAVIGATION -o p.cert --kind maximal --box inputs/box.json
        box-wrong         certify NAVIGATION -o p.cert --kind box --box inputs/parameters.toml
        *alethe           certify SMALL -o p.cert --alethe proofs --json
        alethe-region     certify NAVIGATION -o p.cert --kind region --alethe proofs
        network-{text,--json}   certify UNSAT -o p.cert %1 && verify p.cert UNSAT %1
        network-possible  certify KITCHEN -o p.cert
        parameter         certify NAVIGATION -o p.cert --parameter to_ridge,lb=25 --quiet && verify p.cert NAVIGATION
                            --parameter to_ridge,lb=25
        two-files         certify PROBLEM -o p.cert
        timeout-{text,--json}   certify NAVIGATION -o p.cert --timeout 1e-9 %1
        no-certificate    verify inputs/box.json
        no-file           verify nowhere.cert
        """,
    "pike-check": """
        {KITCHEN,WING,UNSAT}-{oracle,pitms,atms,sat,bdd}   pike check %1 --backend %2 --json
        all-{oracle,pitms,atms,sat,bdd}   pike check KITCHEN --backend %1 --all-scenarios --assume xA1=mug --json
        all-sat-{oracle,pitms,atms,sat,bdd}   pike check SAT --backend %1 --all-scenarios --json
        text-{KITCHEN,WING,UNSAT}   pike check %1
        all-text          pike check KITCHEN --all-scenarios --assume xA1=glass
        refuted           pike check KITCHEN --assume xA1=mug --assume xR1=juice
        refuted-json      pike check KITCHEN --assume xA1=mug --assume xR1=juice --json
        apsp-{pitms,bdd,atms}   pike check KITCHEN --backend %1 --temporal apsp --json
        cvc5              pike check KITCHEN --solver cvc5 --json
        epsilon           pike check KITCHEN --epsilon 1/10 --json
        *cross-{KITCHEN,SAT,UNSAT}   pike check %1 --cross --json
        *cross-text       pike check SAT --cross --seed 3
        quiet             pike check KITCHEN --quiet
        timeout-{text,--json}   pike check KITCHEN --timeout 1e-9 %1
        """,
    "pike-compile": """
        {KITCHEN,WING,UNSAT}-{pitms,atms,sat,bdd}   pike compile %1 --backend %2 --json
        apsp-{pitms,atms,sat,bdd}   pike compile KITCHEN --backend %1 --temporal apsp --json
        text-{pitms,atms,sat,bdd}   pike compile KITCHEN --backend %1
        {shortcut,no-shortcut}   pike compile UNSAT --%1 --json
        implicants-{pitms,bdd,sat}   pike compile KITCHEN --backend %1 --implicants --json
        implicants-text   pike compile KITCHEN --implicants
        no-models         pike compile KITCHEN --no-models --json
        cvc5              pike compile KITCHEN --solver cvc5 --epsilon 1/100 --json
        timeout-{text,--json}   pike compile KITCHEN --timeout 1e-9 %1
        """,
    "pike-run": """
        {smt,pitms,atms,sat,bdd}   pike run KITCHEN --backend %1 --outcome xA1=mug --seed 1 --json
        text-{KITCHEN,WING,SAT,UNSAT}   pike run %1
        wing              pike run WING --seed 3 --json
        fails             pike run KITCHEN --outcome xA1=mug --outcome xA3=bagel
        fails-json        pike run KITCHEN --outcome xA1=mug --outcome xA3=bagel --explain --json
        explain           pike run KITCHEN --outcome xA1=mug --explain
        explain-json      pike run KITCHEN --outcome xA1=mug --explain --json
        outcome-at        pike run KITCHEN --outcome xA1=glass@1/2 --json
        careless          pike run KITCHEN --human careless --seed 5
        pace-{least,random}   pike run KITCHEN --pace %1 --seed 2 --json
        delay             pike run KITCHEN --delay 1/2 --seed 4
        no-infer          pike run KITCHEN --no-infer --outcome xA1=mug
        disturb-{text,--json}   pike run KITCHEN --outcome xA1=mug --disturb '(not (working toaster))@1' %1
        disturb-explained   pike run KITCHEN --outcome xA1=mug --disturb '(not (have mug))@1' --explain
        cvc5              pike run KITCHEN --solver cvc5 --epsilon 1/100
        quiet             pike run KITCHEN --quiet
        plot-{svg,png,pdf}   pike run KITCHEN --outcome xA1=mug --plot run.%1 --quiet
        stdio-{smt,pitms}   pike run KITCHEN --stdio --backend %1 < inputs/kitchen-story.jsonl
        stdio-noise       pike run KITCHEN --stdio < inputs/noise.jsonl
        stdio-failure     pike run KITCHEN --stdio < inputs/failure.jsonl
        stdio-nothing     pike run KITCHEN --stdio < inputs/nothing.jsonl
        stdio-resumed     pike run KITCHEN --stdio --journal journal < inputs/story-first.jsonl
                            && pike run KITCHEN --stdio --journal journal < inputs/story-rest.jsonl
        stdio-other-epsilon   pike run KITCHEN --stdio --journal journal < inputs/nothing.jsonl
                            && pike run KITCHEN --stdio --journal journal --epsilon 1/500 < inputs/nothing.jsonl
        timeout-{text,--json}   pike run KITCHEN --timeout 1e-9 %1
        """,
    "pike-plot": """
        {svg,png,pdf}     pike plot KITCHEN -o plan.%1 --json
        text              pike plot WING -o plan.svg
        links             pike plot KITCHEN -o plan.svg --links --assume xA1=mug --json
        """,
    "demo": "tour  demo",
    "bench": """
        *recorded-json              bench recorded --suite inputs/suite --json
        *+recorded-text             bench recorded --suite inputs/suite
        *figure3-json               bench figure3 --suite inputs/suite --limit 60 --json
        *+figure3-text              bench figure3 --suite inputs/suite --limit 60
        *figure5-json               bench figure5 --suite inputs/suite --limit 60 --json
        *+figure5-text              bench figure5 --suite inputs/suite --limit 60 --plot steps.svg
        *{scaling,backends,encodings}-json   bench %1 --limit 1/1000 --json
        *+{scaling,backends,encodings}-text   bench %1 --limit 1/1000
        *figure4-json               bench figure4 --limit 1/1000 --baseline-limit 1/1000 --json
        *conversions-json           bench conversions --drawn 1 --delivery 1 --planned 0 --json
        *+conversions-text          bench conversions --drawn 1 --delivery 0 --planned 0
        *figure20a-json             bench figure20a --instances 2 --json
        *+figure20a-text            bench figure20a --instances 1 --backend pitms --backend bdd
        *figure20b-json             bench figure20b --problems 2 --json
        *+figure20b-text            bench figure20b --problems 2 --backend smt
        *figure21-json              bench figure21 --instances 2 --json
        *+figure21-text             bench figure21 --instances 2
        *{figure17,figure18}-json   bench %1 --problems 3 --largest 3 --json
        *+{figure17,figure18}-text   bench %1 --problems 3 --largest 3 --store results.store --quiet
        *table1-json                bench table1 --problems 1 --parameters 1 --planner PLANNER --json
        *table2-json                bench table2 --problems 1 --planner PLANNER --json
        *+{table1,table2}-text      bench %1 --problems 1 --planner PLANNER
        """,
    "bad": """
        missing-file           check PROBLEM examples/two_sample_navigation/plann.stn
        directory              check PROBLEM examples
        wrong-order            check examples/two_sample_navigation/problem.pddl PROBLEM
        plan-first             envelope examples/two_sample_navigation/plan.stn PROBLEM
        missing-argument       check domain.pddl
        unknown-command        chekc
        unknown-bench          bench figure99
        epsilon-{tiny,-1/1000,1/0}   check NAVIGATION --epsilon=%1
        timeout-{0,nan,soon}   envelope NAVIGATION --timeout %1
        solver                 check NAVIGATION --solver z4
        no-parameters          check NAVIGATION --parameters nowhere.toml
        parameter-{duration:nothing,==}   check NAVIGATION --parameter %1
        parameter-weight       check NAVIGATION --parameter to_ridge,weight=x
        no-such-option         check NAVIGATION --nothing
        surplus                check NAVIGATION surplus
        at-{to_rigde=3,to_ridge,=3,to_ridge=x,to_ridge=5:4,to_ridge=5:,to_ridge=inf:5}   check NAVIGATION --at %1
        at-twice               check NAVIGATION --at to_ridge=5 --at to_ridge=6
        beta-{0,-1,one}        envelope NAVIGATION --method irr --beta=%1
        beta-without-irr       envelope NAVIGATION --beta 1
        doubling-without-irr   envelope NAVIGATION --doubling
        contain-without-optimal   envelope NAVIGATION --contain-nominal
        order-with-optimal     envelope NAVIGATION --method optimal --order to_ridge
        method                 envelope NAVIGATION --method magic
        encoding               envelope NAVIGATION --encoding positional
        order-unknown          envelope NAVIGATION --order to_rigde
        order-twice            envelope NAVIGATION --order to_ridge,to_ridge
        order-empty            envelope NAVIGATION --order to_ridge,,to_crater
        plot-{box.gif,nowhere/box.svg}   envelope NAVIGATION --plot %1
        plot-before-input      envelope no-domain no-problem no-plan --plot box.gif
        smt2-file              check NAVIGATION --smt2 inputs/box.json
        json-error             check PROBLEM nowhere.stn --json
        region-{backend,splitting,form}   region NAVIGATION --%1 magic
        axes-without-plot      region NAVIGATION --axes to_ridge
        axes-unknown           region NAVIGATION --plot r.svg --axes to_rigde
        latex-json             region NAVIGATION --latex --json
        html-nowhere           compare NAVIGATION --html nowhere/report.html
        convert-{duration:fly,speed:go}   convert STEPS --parametrize %1
        convert-default        convert STEPS --parametrize duration:drive,default=6
        convert-mode           convert STEPS --mode free
        convert-output-{nowhere/plan.stn,plan.toml,/}   convert STEPS -o %1
        executor-{drex,blex:x}   execute NAVIGATION --executor %1
        execute-runs           execute NAVIGATION --runs 0
        execute-replans        execute NAVIGATION --replans -1
        execute-planner        execute NAVIGATION --planner arees
        execute-planner-limit  execute NAVIGATION --planner-limit 0
        execute-planning-time  execute NAVIGATION --planning-time=-3
        execute-plot           execute NAVIGATION --plot run.jpg
        execute-world          execute NAVIGATION --world absent.toml
        execute-parametrize    execute NAVIGATION --parametrize duration:fly
        certify-nowhere        certify NAVIGATION -o no/where
        certify-kind           certify NAVIGATION -o p.cert --kind none
        pike-file              pike check none.tpnu.json
        pike-pddl              pike check examples/kitchen/domain.pddl
        pike-assume-{xA1,xA1=jug,xB=mug}   pike check KITCHEN --assume %1
        pike-assume-twice      pike check KITCHEN --assume xA1=mug --assume xA1=glass
        pike-epsilon           pike check KITCHEN --epsilon 0
        pike-implicants        pike compile KITCHEN --backend atms --implicants
        pike-outcome-{xA1,xA1=bucket,xB=mug,xR1=juice,xA1=mug@soon,xA1=mug@-1}   pike run KITCHEN --outcome %1
        pike-disturb-{working,not}   pike run KITCHEN --disturb '%1 toaster@1'
        pike-disturb-unknown   pike run KITCHEN --disturb '(working toster)@1'
        pike-disturb-when      pike run KITCHEN --disturb '(not (working toaster))'
        pike-delay             pike run KITCHEN --delay x
        pike-backend           pike run KITCHEN --backend smtt
        pike-plot              pike run KITCHEN --plot run.txt
        pike-picture           pike plot KITCHEN -o plan.gif
        stdio-{--no-infer,--plot=p.svg,--delay=1}   pike run KITCHEN --stdio %1
        stdio-outcome          pike run KITCHEN --stdio --outcome xA1=mug
        without-stdio-journal  pike run KITCHEN --journal j
        without-stdio-clock    pike run KITCHEN --clock real
        stdio-rate             pike run KITCHEN --stdio --rate 2
        stdio-rate-0           pike run KITCHEN --stdio --clock real --rate 0
        stdio-backend          pike run KITCHEN --stdio --backend smtt
        bench-limit            bench scaling --limit 0
        bench-jobs-{0,many}    bench scaling --jobs %1
        bench-plot             bench scaling --plot plot.txt
        bench-suite            bench recorded --suite nowhere
        bench-no-suite         bench figure3
        bench-backend          bench figure20a --backend magic
        bench-planner          bench table1 --planner arees
        """,
}
"""By group: the name of a case and its command lines, in which words of `WORDS` stand for files.

A name with `{a,b}` stands for one case for each value, which `%1`, `%2`, ... of the lines repeat (`text` and `json` are
no words of a line: they stand for nothing and `--json`). `&&` separates lines, `< FILE` is what stdin has. Marks
before a name: `*` slow, `+` all numbers of the text are masked.
"""

DROPPED = {
    "compare-generator-text, compare-generator-json": "the order of the two polyhedra and some witnesses vary",
    "envelope-widen-positions-cvc5": "the steps of its convergence follow cvc5's models, which differ between two runs",
    "envelope-optimal-positions on NAVIGATION": "25 s, and the same on SMALL is in the table",
    "region-positions, compare-positions on NAVIGATION": "do not end within minutes; those on SMALL are in the table",
    "certify --encoding positions on NAVIGATION": "25 s for each kind of certificate; the one on SMALL is in the table",
}
"""Cases that were tried and are not in the table, and why."""


def cases() -> list[Case]:
    """The whole table, in order; names are unique."""
    found = [case for group, rows in TABLE.items() for row in _rows(rows) for case in _expanded(group, row)]
    found += _bad_inputs()
    names = [case.name for case in found]
    if twice := {name for name in names if names.count(name) > 1}:
        raise ValueError(f"found names twice: {', '.join(sorted(twice))}")
    return found


def _rows(text: str) -> Iterator[str]:
    """The rows of a group; what is indented more than the first one goes on."""
    rows: list[str] = []
    lines = [line for line in text.splitlines() if line.strip()]
    margin = len(lines[0]) - len(lines[0].lstrip())
    for line in lines:
        if len(line) - len(line.lstrip()) > margin:
            rows[-1] += " " + line.strip()
        else:
            rows.append(line.strip())
    yield from rows


def _expanded(group: str, row: str) -> Iterator[Case]:
    template, _, text = row.partition(" ")
    marks = template[: len(template) - len(template.lstrip("*+"))]
    parts = re.split(r"\{([^{}]*)\}", template.removeprefix(marks))
    for values in itertools.product(*(part.split(",") for part in parts[1::2])):
        name = "".join(itertools.chain(*itertools.zip_longest(parts[::2], values, fillvalue="")))
        filled = text
        for number, value in enumerate(values, 1):
            filled = filled.replace(f"%{number}", "" if value == "text" else value)
        lines = tuple(" ".join(WORDS.get(word, word) for word in line.split()) for line in filled.split("&&"))
        yield Case(f"{group}-{_slug(name)}", lines, slow="*" in marks, masked="+" in marks)


def _slug(name: str) -> str:
    """What a file may be called."""
    return re.sub(r"[^A-Za-z0-9]+", "-", name).strip("-").lower()


def _bad_inputs() -> Iterator[Case]:
    """One case for each row of the table of wrong inputs, and some files that are no text or none at all."""
    names = {"domain": "domain.pddl", "problem": "problem.pddl", "plan": "plan.stn"}
    right = {"domain": inputs.DOMAIN, "problem": inputs.PROBLEM, "plan": inputs.PLAN}
    line = f"check {' '.join(names.values())}"
    for bad in BAD_INPUTS:
        texts = {**right, bad.file: right[bad.file].replace(bad.old, bad.new)}
        yield Case(f"bad-input-{_slug(bad.name)}", (line,), files={names[part]: text for part, text in texts.items()})
    for part, name in names.items():
        files = {names[other]: text for other, text in right.items()}
        yield Case(f"bad-input-{part}-binary", (line,), files={**files, name: bytes(range(256)) * 8})
        yield Case(f"bad-input-{part}-empty", (line,), files={**files, name: ""})


# -- running -----------------------------------------------------------------------------------------------------------


Ended = tuple[int, str, str]
"""An exit code, and what was printed on stdout and stderr."""
Runner = Callable[[Sequence[str], Path, bytes], Ended]
"""Runs the words of a command line in a directory, with something on stdin."""


def processes(command: Sequence[str]) -> Runner:
    """Each command line as a process of its own."""

    def run(words: Sequence[str], directory: Path, given: bytes) -> Ended:
        options: dict[str, Any] = {"cwd": directory, "env": _environment(), "timeout": LIMIT}
        done = subprocess.run([*command, *words], input=given, capture_output=True, check=False, **options)
        out, err = (stream.decode("utf-8", errors="backslashreplace") for stream in (done.stdout, done.stderr))
        return done.returncode, out, err

    return run


THIS = processes((sys.executable, "-m", "robust"))
"""With this interpreter and the package that it finds."""


def in_process(words: Sequence[str], directory: Path, given: bytes) -> Ended:
    """In this process and its main thread, without the seconds that a start takes; nothing can be on stdin."""
    from robust.cli import run  # noqa: PLC0415 - only for those that run here

    if given or "--stdio" in words:
        raise ValueError("found something on stdin, expected a case for processes")
    out, err, before = StringIO(), StringIO(), dict(os.environ)
    logger = logging.getLogger("robust")
    try:
        os.environ.clear()
        os.environ.update(_environment())
        with chdir(directory), redirect_stdout(out), redirect_stderr(err):
            code = run(list(words))
    finally:
        os.environ.clear()
        os.environ.update(before)
        logger.handlers.clear()
        logger.setLevel(logging.NOTSET)
    return code, out.getvalue(), err.getvalue()


@dataclass(frozen=True)
class Place:
    """Where the files of cases come from, and what runs them."""

    checkout: Path = CHECKOUT
    run: Runner = THIS

    @property
    def dataset(self) -> Path:
        return Path(os.environ.get("ROBUST_DATASET") or self.checkout.parent / "shared" / "paper-dataset")

    def can(self, case: Case) -> bool:
        return self.dataset.is_dir() or not case.needs_dataset

    def prepare(self, case: Case, directory: Path) -> None:
        """Put into an empty directory what a case reads."""
        shutil.copytree(INPUTS, directory / "inputs")
        (directory / "examples").symlink_to(self.checkout / "robust" / "examples")
        (directory / "domains").symlink_to(self.checkout / "benchmarks" / "domains")
        if self.dataset.is_dir():
            (directory / "dataset").symlink_to(self.dataset.resolve())
        for name, content in case.files.items():
            (directory / name).write_bytes(content.encode() if isinstance(content, str) else content)

    def recorded(self, case: Case) -> str:
        """Run a case; everything that is compared of it."""
        with tempfile.TemporaryDirectory(prefix="recording-") as name:
            directory = Path(name).resolve()
            self.prepare(case, directory)
            before = set(_found(directory))
            parts = [part for line in case.lines for part in self._ran(line, directory, case)]
            made = [f"{each.relative_to(directory)}:{_kept(each)}" for each in _found(directory) if each not in before]
            parts += ["-- files", *(self._unplaced(text, directory) for text in made)] if made else []
        return "\n".join(parts) + "\n"

    def _ran(self, line: str, directory: Path, case: Case) -> Iterator[str]:
        command, _, source = line.partition(" < ")
        words = [word.replace("@work@", str(directory)) for word in shlex.split(command)]
        given = (directory / source.strip()).read_bytes() if source else b""
        yield f"$ robust {' '.join(line.split())}"
        try:
            code, *streams = self.run(words, directory, given)
        except subprocess.TimeoutExpired:
            yield f"killed after {LIMIT:g} s"
            return
        yield f"exit {code}"
        for name, stream in zip(("stdout", "stderr"), streams, strict=True):
            if stream:
                kind, text = _masked(stream, case.masked)
                yield f"-- {name}{kind}"
                yield self._unplaced(text, directory).rstrip("\n")

    def _unplaced(self, text: str, directory: Path) -> str:
        text = text.replace(str(directory), "@work@").replace(str(self.checkout), "@checkout@")
        text = re.sub(r"/\S*(?=/robust/examples\b)", "@checkout@", text)
        return text.replace(str(self.dataset.resolve()), "@dataset@")


def _environment() -> dict[str, str]:
    """Of commands: a terminal of fixed width without colours; nothing about hashes."""
    dropped = {"PYTHONHASHSEED", "NO_COLOR", "FORCE_COLOR", "TERM", "COLORTERM"}
    kept = {name: value for name, value in os.environ.items() if name not in dropped}
    return {**kept, "COLUMNS": str(COLUMNS), "LINES": "40", "LC_ALL": "C.UTF-8", "TERM": "dumb", "MPLBACKEND": "agg"}


def _found(directory: Path) -> list[Path]:
    """The files below a directory, but not below links."""
    return sorted(
        Path(top) / name for top, _, names in os.walk(directory) for name in names if not name.endswith(".pyc")
    )


_KINDS = {b"<?xml": "svg", b"\x89PNG": "png", b"%PDF": "pdf", b"<!DOC": "html", b"\x1f\x8b": "gzip"}
_NAMED = {".smt2", ".alethe", ".store"}


def _kept(path: Path) -> str:
    """What is compared of a file that a command made."""
    content = path.read_bytes()
    for head, kind in _KINDS.items():
        if content.startswith(head):
            return f" {kind}"
    if path.suffix in _NAMED or b"\0" in content:
        return " something" if content else " empty"
    return "\n" + _masked(content.decode("utf-8"), everything=False)[1].rstrip("\n")


# -- masking -----------------------------------------------------------------------------------------------------------

MEASURED = re.compile(
    r"^(?!(baseline_)?limit)(.*_)?"
    r"(seconds|s|ms|mb|bytes|stages|memory|latency|latencies|with_computing|with_free_recovery)$"
)
"""Keys of JSON below which numbers are measured."""
_UNIT = re.compile(r" *(?<![\w.])\d[\d,]*(?:\.\d+)?(?:e-?\d+)? (s|ms|MiB|MB|bytes)\b")
_VERSION = re.compile(r"\brobust \d+\.\d+\S*")
_LAYOUT = re.compile(r"[┏┓┗┛┡┩┠┨┳┻╇┷┴┬┼├┤└┘┌┐━─╸╺]+")
_NUMBER = re.compile(r"(?<![A-Za-z_])[+-]?\d[\d,]*(\.\d+)?(e[+-]?\d+)?")


def _masked(text: str, everything: bool) -> tuple[str, str]:
    """Of what a command printed: a word about its layout, and it without what varies."""
    try:
        value = json.loads(text)
    except ValueError:
        return "", _masked_text(text, everything)
    if not isinstance(value, dict | list):
        return "", _masked_text(text, everything)
    layouts = ((None, " (one line)"), (2, " (indented)"))
    written = {json.dumps(value, ensure_ascii=False, indent=indent) + "\n": layout for indent, layout in layouts}
    return written.get(text, " (JSON)"), _folded(_masked_value(value, measured=False))


def _masked_text(text: str, everything: bool) -> str:
    text = _VERSION.sub("robust #", text)
    text = _UNIT.sub(r" # \1", text)
    if everything:
        text = _LAYOUT.sub("─", _NUMBER.sub("#", text))
        text = re.sub(r"[ \t]+", " ", text)
    return "\n".join(line.rstrip() for line in text.splitlines())


def _masked_value(value: Any, *, measured: bool) -> Any:
    match value:
        case dict():
            below = {key: measured or MEASURED.search(key) is not None for key in value}
            return {key: _masked_value(item, measured=below[key]) for key, item in value.items()}
        case list():
            return [_masked_value(item, measured=measured) for item in value]
        case bool():
            return value
        case int() | float():
            return "#" if measured else value
        case _:
            return _UNIT.sub(r" # \1", value) if isinstance(value, str) else value


def _folded(value: Any, depth: int = 0) -> str:
    """JSON in which what fits stands on one line."""
    line = json.dumps(value, ensure_ascii=False)
    if not isinstance(value, dict | list) or len(line) + depth <= 110:
        return line
    deeper = depth + 1
    if isinstance(value, dict):
        items = [f"{json.dumps(key)}: {_folded(item, deeper)}" for key, item in value.items()]
    else:
        items = [_folded(item, deeper) for item in value]
    inner = ",\n".join(f"{' ' * deeper}{item}" for item in items)
    return f"{line[0]}\n{inner}\n{' ' * depth}{line[-1]}"


# -- the command line --------------------------------------------------------------------------------------------------


def difference(case: Case, place: Place, data: Path, *, loose: bool = False) -> str:
    """A unified diff of what is recorded and what a case comes to now; empty if nothing differs."""
    path = data / f"{case.name}.txt"
    old = path.read_text(encoding="utf-8") if path.exists() else ""
    new = place.recorded(case)
    if loose and _loosened(old) == _loosened(new):
        return ""
    names = (f"recorded/{path.name}", f"now/{path.name}")
    return "\n".join(difflib.unified_diff(old.splitlines(), new.splitlines(), *names, lineterm=""))


_EFFORT = re.compile(
    r'(?<="checks": )\d+|(?<="pieces": )\d+|(?<="queries": )\d+|(?<="satisfiable": )\d+|(?<="unsatisfiable": )\d+'
    r'|(?<="unknown": )\d+|(?<="nodes": )\d+|\b\d+(?= checks\b| polyhedra of bad values)'
)
_STEP = re.compile(r'\{"check": .*|"convergence": .*|queries/\d+-.*|[][{}]*')


def _loosened(text: str) -> list[str]:
    """Without what depends on which models a solver happens to find: counts of its work, and the order of lines."""
    lines = [_EFFORT.sub("#", line).strip().rstrip(",") for line in text.splitlines()]
    return sorted(line for line in lines if not _STEP.fullmatch(line))


def main(arguments: Sequence[str] | None = None) -> int:
    options = _parser().parse_args(arguments)
    run = in_process if options.in_process else processes(shlex.split(options.command))
    place = Place(options.checkout.resolve(), run)
    chosen = [case for case in cases() if _matches(case.name, options.only) and not (options.quick and case.slow)]
    if options.in_process:
        chosen = [case for case in chosen if not case.needs_process]
    if options.action == "list":
        print(*(f"{case.name}{' slow' if case.slow else ''}" for case in chosen), sep="\n")
        return 0
    data: Path = options.directory
    data.mkdir(parents=True, exist_ok=True)
    if options.new:
        chosen = [case for case in chosen if not (data / f"{case.name}.txt").exists()]
    able = [case for case in chosen if place.can(case)]
    differing = []
    started = time.monotonic()

    def work(case: Case) -> tuple[Case, str, float]:
        begun = time.monotonic()
        if options.action == "compare":
            return case, difference(case, place, data, loose=options.loose), time.monotonic() - begun
        (data / f"{case.name}.txt").write_text(place.recorded(case), encoding="utf-8")
        return case, "", time.monotonic() - begun

    with ThreadPoolExecutor(options.jobs) as pool:
        for case, text, seconds in map(work, able) if options.in_process else pool.map(work, able):
            if text:
                differing.append(case.name)
                print(text, flush=True)
            if options.times:
                print(f"{seconds:6.2f} s  {case.name}", file=sys.stderr, flush=True)
    if options.action == "compare" and not (options.only or options.quick or options.new or options.in_process):
        known = {case.name for case in chosen}
        stray = sorted(path.stem for path in data.glob("*.txt") if path.stem not in known)
        differing += stray
        print(*(f"{name}: recorded, but not in the table" for name in stray), sep="\n", end="\n" if stray else "")
    _summarise(len(able), len(chosen) - len(able), differing, time.monotonic() - started)
    return 1 if differing else 0


def _summarise(ran: int, left_out: int, differing: Sequence[str], seconds: float) -> None:
    print(f"{ran} cases in {seconds:.0f} s, {len(differing)} differ, {left_out} left out", *differing, file=sys.stderr)


def _matches(name: str, pattern: str | None) -> bool:
    return pattern is None or pattern in name or fnmatch.fnmatch(name, pattern)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("action", choices=["record", "compare", "list"])
    parser.add_argument("directory", nargs="?", type=Path, default=Path(__file__).parent / "data")
    parser.add_argument("--only", metavar="PATTERN", help="a shell pattern for names, or a part of them")
    parser.add_argument("--quick", action="store_true", help="without the slow ones")
    parser.add_argument("--new", action="store_true", help="only those that are not recorded yet")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="commands at a time")
    parser.add_argument("--command", default=f"{sys.executable} -m robust", help="default: robust of this interpreter")
    parser.add_argument("--loose", action="store_true", help="whatever the order of lines and the work of solvers")
    parser.add_argument("--in-process", action="store_true", help="run commands in this process, where they can")
    parser.add_argument("--checkout", type=Path, default=CHECKOUT, metavar="DIR", help="where examples are found")
    parser.add_argument("--times", action="store_true", help="say on stderr how long each case takes")
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
