"""Plans of one problem in the order of what they bear: job shops, executed with durations that deviate."""

from fractions import Fraction
from random import Random

import numpy
import pytest
from scipy.stats import kendalltau

import robust
from robust import InputError, load_plan
from robust.network.differences import Distances
from robust.plan.model import ZERO
from robust.sweeps.rank import Fitness
from tests.cli.running import example

DEADLINE = "+2%"
SHOP = """(define (domain shop)
(:requirements :typing :durative-actions)
(:types step machine)
(:predicates (free ?m - machine) (ready ?s - step) (on ?s - step ?m - machine) (next ?s ?t - step) (done ?s - step))
(:functions (length ?s - step))
(:durative-action work :parameters (?s ?t - step ?m - machine) :duration (= ?duration (length ?s))
 :condition (and (at start (free ?m)) (at start (ready ?s)) (at start (on ?s ?m)) (at start (next ?s ?t)))
 :effect (and (at start (not (free ?m))) (at end (free ?m)) (at start (not (ready ?s))) (at end (ready ?t))
  (at end (done ?s)))))"""


def shop(draw, folder, jobs, plans):
    """Files of a job shop: each job visits all machines in an order of its own; plans take the jobs in random turns."""
    steps = {job: draw.sample(range(jobs), jobs) for job in range(jobs)}
    length = {(job, at): draw.randint(5, 40) for job in steps for at in range(jobs)}
    facts = [f"(free m{number})" for number in range(jobs)]
    for job, machines in steps.items():
        facts.append(f"(ready s{job}x0)")
        for at, machine in enumerate(machines):
            facts += [f"(on s{job}x{at} m{machine})", f"(next s{job}x{at} s{job}x{at + 1})"]
            facts.append(f"(= (length s{job}x{at}) {length[job, at]})")
    names = " ".join(f"s{job}x{at}" for job in steps for at in range(jobs + 1))
    (folder / "domain.pddl").write_text(SHOP)
    (folder / "problem.pddl").write_text(
        f"(define (problem p) (:domain shop) (:objects {names} - step {' '.join(f'm{m}' for m in steps)} - machine)"
        f"(:init {' '.join(facts)}) (:goal (and {' '.join(f'(done s{job}x{jobs - 1})' for job in steps)})))"
    )
    files = []
    for number in range(plans):
        turns = [job for job in steps for _ in range(jobs)]
        draw.shuffle(turns)
        free = dict.fromkeys([*(("job", job) for job in steps), *range(jobs)], Fraction(0))
        at, lines = dict.fromkeys(steps, 0), []
        for job in turns:
            machine = steps[job][at[job]]
            start = max(free["job", job], free[machine]) + Fraction(1, 1000)
            free["job", job] = free[machine] = start + length[job, at[job]]
            name = f"s{job}x{at[job]}"
            lines.append(f"{float(start):.3f}: (work {name} s{job}x{at[job] + 1} m{machine}) [{length[job, at[job]]}]")
            at[job] += 1
        files.append(folder / f"plan{number}.plan")
        files[-1].write_text("\n".join(lines))
    return files


def shares_in_time(folder, files, latest, draw, runs):
    """Of each plan the share of executions, as early as its network allows, that end in time: durations ± 15 %."""
    for file in files:
        plan = load_plan(folder / "domain.pddl", folder / "problem.pddl", file, parameters="duration:*")
        points = [point for point in plan.time_points if point.time is None]
        reached = 0
        for _ in range(runs):
            values = {name: value * Fraction(max(0.0, draw.gauss(1, 0.15))) for name, value in plan.nominal.items()}
            edges = [(ZERO, point, Fraction(0)) for point in points]
            for bound in plan.constraints:
                for weight, (a, b), sign in (
                    (bound.lower, (bound.source, bound.target), 1),
                    (bound.upper, (bound.target, bound.source), -1),
                ):
                    if weight is not None:
                        number = weight.constant_term + sum(f * values[str(v)] for v, f in weight.coefficients())
                        edges.append((a, b, sign * round(number, 6)))
            reached += max(Distances(points, edges).times.values()) <= latest
        yield reached / runs


@pytest.mark.parametrize(
    ("problems", "jobs", "plans", "runs"), [(2, 3, 3, 40), pytest.param(20, 4, 4, 300, marks=pytest.mark.slow)]
)
def test_what_bears_more_is_more_often_in_time(problems, jobs, plans, runs, tmp_path):
    draw, agreement, by_end = Random(7), [], []  # noqa: S311
    for number in range(problems):
        folder = tmp_path / str(number)
        folder.mkdir()
        files = shop(draw, folder, jobs, plans)
        ranking = robust.rank(folder / "domain.pddl", folder / "problem.pddl", files, deadline=DEADLINE)
        assert ranking.status is robust.Status.COMPLETE
        ranked = {plan.name: plan for plan in ranking.plans}
        ratios = [ranked[file.name].tolerance.ratio for file in files]
        assert [plan.tolerance.ratio for plan in ranking.plans] == sorted(ratios, reverse=True)
        shares = list(shares_in_time(folder, files, ranking.latest, draw, runs))
        agreement.append(kendalltau(list(map(float, ratios)), shares)[0])
        by_end.append(kendalltau([-float(ranked[file.name].end) for file in files], shares)[0])

    assert numpy.nanmean(agreement) >= 0.8


def test_wrong_and_late_plans_come_last_and_say_why(tmp_path):
    domain, problem, _ = example()
    (tmp_path / "wrong.plan").write_text("1: (drive scout)")
    ranking = robust.rank(domain, problem, [tmp_path / "wrong.plan", *example()[2:]], deadline="1000")
    assert [plan.fitness for plan in ranking.plans] == [Fitness.VALID, Fitness.WRONG]
    assert "before" in ranking.deciding[0]
    late = robust.rank(domain, problem, example()[2:], deadline="3")
    assert [plan.fitness for plan in late.plans] == [Fitness.LATE]
    with pytest.raises(InputError, match="found no plan that can be read"):
        robust.rank(domain, problem, [tmp_path / "none.plan"])
