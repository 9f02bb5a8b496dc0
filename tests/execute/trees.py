"""Behavior trees by hand, of plans in four domains, with what is right or wrong about them; and an interpreter."""

import heapq
import itertools
import math
import re
import xml.etree.ElementTree as ET
from collections import defaultdict
from fractions import Fraction

EPSILON = Fraction(1, 1000)

# -- an interpreter ----------------------------------------------------------------------------------------------------


def parsed(text):
    return ET.fromstring(text)  # noqa: S314 - our own texts


class Interpreter:
    """Executes a tree: starts come at once or are held back, and actions last as they are told to.

    `hold` says until when the start of an action is held back, or `late` how long once it could start; `durations` how
    long actions last; all by their names.
    In a sequence each thing happens ε after what came before it; children of Parallel may do things at one time.
    Each child of a Parallel is a process, which pauses until a time, or for an action or a Parallel to be done. Times
    inside are whole numbers of the largest unit that divides all of those given.
    """

    def __init__(self, text, durations, hold=(), late=()):
        self.root = next(parsed(text).iter("BehaviorTree"))[0]
        given = [dict(durations), dict(hold), dict(late)]
        every = [EPSILON, *(time for times in given for time in times.values())]
        self.unit = math.lcm(*(time.denominator for time in every))
        self.durations, self.hold, self.late = ({key: self.whole(times[key]) for key in times} for times in given)
        self.gap, self.time, self.number = self.whole(EPSILON), 0, itertools.count()
        self.starts, self.ends, self.done, self.needed = {}, {}, set(), {}
        self.queue, self.waiting = [], defaultdict(list)

    def whole(self, time):
        return time.numerator * self.unit // time.denominator

    def run(self):
        """The starts and ends of all actions; None for an execution that fails or never ends."""
        root = self.perform(self.root)
        self.resume(root, 0)
        while self.queue:
            self.time, _, process = heapq.heappop(self.queue)
            awaited = next(process, None)
            if isinstance(awaited, int):
                self.resume(process, awaited)
            elif awaited is not None:
                self.waiting[awaited].append(process)
            elif process is root:
                found = (self.starts, self.ends)
                return tuple({key: Fraction(times[key], self.unit) for key in times} for times in found)
        return None

    def resume(self, process, time):
        heapq.heappush(self.queue, (time, next(self.number), process))

    def end(self, awaited):
        for process in self.waiting.pop(awaited, ()):
            self.resume(process, self.time)

    def perform(self, node):
        action = node.get("action")
        match node.tag:
            case "Sequence" | "SequenceStar" | "ReactiveSequence":
                for child in node:
                    yield from self.perform(child)
            case "Parallel":
                self.needed[node] = int(node.get("success_threshold"))
                for child in node:
                    self.resume(self.branch(node, child), self.time)
                yield node
            case "WaitAction" if action not in self.done:
                yield action
            case "CheckAction" if action not in self.done:
                yield "a failure, after which nothing goes on"
            case "WaitAtStartReq":
                yield max(self.time, self.hold.get(action, self.time + self.late.get(action, 0)))
            case "ApplyAtStartEffect":
                self.starts[action] = self.time
                yield self.time + self.gap
            case "ExecuteAction":
                start = self.starts.setdefault(action, self.time)
                end = self.ends.setdefault(action, start + self.durations[action])
                yield max(self.time, end + self.gap)
            case "ApplyAtEndEffect":
                self.done.add(action)
                self.end(action)

    def branch(self, node, child):
        yield from self.perform(child)
        self.needed[node] -= 1
        if not self.needed[node]:
            self.end(node)


# -- plans, and trees of them by hand ----------------------------------------------------------------------------------

PHOTOS = """(define (domain photos)
 (:requirements :durative-actions :typing)
 (:types robot place)
 (:predicates (at ?r - robot ?p - place) (have ?p - place) (ready) (sent))
 (:durative-action drive :parameters (?r - robot ?a ?b - place) :duration (= ?duration 10)
  :condition (at start (at ?r ?a)) :effect (and (at start (not (at ?r ?a))) (at end (at ?r ?b))))
 (:durative-action photo :parameters (?r - robot ?p - place) :duration (= ?duration 4)
  :condition (over all (at ?r ?p)) :effect (at end (have ?p)))
 (:durative-action merge :parameters (?a ?b - place) :duration (= ?duration 2)
  :condition (and (at start (have ?a)) (at start (have ?b))) :effect (at end (ready)))
 (:durative-action send :parameters () :duration (= ?duration 1)
  :condition (at start (ready)) :effect (at end (sent))))
===
(define (problem p) (:domain photos) (:objects r1 r2 - robot base a b - place)
 (:init (at r1 base) (at r2 base)) (:goal (and (sent) (at r1 base))))
===
0.000: (drive r1 base a) [10]
0.000: (drive r2 base b) [10]
10.001: (photo r1 a) [4]
10.001: (photo r2 b) [4]
14.002: (merge a b) [2]
14.002: (drive r1 a base) [10]
16.003: (send) [1]
"""
BAY = """(define (domain bay)
 (:requirements :durative-actions :typing :numeric-fluents)
 (:types part)
 (:predicates (free) (painted ?p - part) (dried ?p - part))
 (:functions (paint))
 (:durative-action paint :parameters (?p - part) :duration (= ?duration 5)
  :condition (and (at start (free)) (at start (>= (paint) 3)))
  :effect (and (at start (not (free))) (at start (decrease (paint) 3)) (at end (free)) (at end (painted ?p))))
 (:durative-action refill :parameters () :duration (= ?duration 8) :effect (at end (increase (paint) 4)))
 (:durative-action dry :parameters (?p - part) :duration (= ?duration 20)
  :condition (at start (painted ?p)) :effect (at end (dried ?p))))
===
(define (problem p) (:domain bay) (:objects x y - part) (:init (free) (= (paint) 4)) (:goal (and (dried x) (dried y))))
===
0.000: (paint x) [5]
0.001: (refill) [8]
5.001: (dry x) [20]
8.002: (paint y) [5]
13.003: (dry y) [20]
"""
GATE = """(define (domain gate)
 (:requirements :durative-actions :typing)
 (:types box)
 (:predicates (opened) (closed) (inside ?b - box) (armed))
 (:durative-action open :parameters () :duration (= ?duration 2) :effect (at end (opened)))
 (:durative-action carry :parameters (?b - box) :duration (= ?duration 6)
  :condition (over all (opened)) :effect (at end (inside ?b)))
 (:durative-action close :parameters () :duration (= ?duration 2)
  :condition (at start (opened)) :effect (and (at start (not (opened))) (at end (closed))))
 (:durative-action arm :parameters () :duration (= ?duration 1)
  :condition (over all (closed)) :effect (at end (armed))))
===
(define (problem p) (:domain gate) (:objects b1 b2 - box) (:init) (:goal (and (inside b1) (inside b2) (armed))))
===
0.000: (open) [2]
2.001: (carry b1) [6]
2.001: (carry b2) [6]
8.002: (close) [2]
10.003: (arm) [1]
"""
LAMPS = """(define (domain lamps)
 (:requirements :durative-actions :typing :negative-preconditions)
 (:types fuse)
 (:predicates (lit) (mended ?f - fuse))
 (:durative-action light :parameters () :duration (= ?duration 30)
  :condition (at start (not (lit))) :effect (and (at start (lit)) (at end (not (lit)))))
 (:durative-action mend :parameters (?f - fuse) :duration (= ?duration 5)
  :condition (over all (lit)) :effect (at end (mended ?f))))
===
(define (problem p) (:domain lamps) (:objects f1 f2 - fuse) (:init) (:goal (and (mended f1) (mended f2))))
===
0.000: (light) [30]
0.001: (mend f1) [5]
30.001: (light) [30]
30.002: (mend f2) [5]
"""
PLANS = {"photos": PHOTOS, "bay": BAY, "gate": GATE, "lamps": LAMPS}
"""Domain, problem and plan, by domain."""
NAMES = {
    "photos": {
        "to_a": "(drive r1 base a):0",
        "to_b": "(drive r2 base b):0",
        "at_a": "(photo r1 a):10001",
        "at_b": "(photo r2 b):10001",
        "merge": "(merge a b):14002",
        "back": "(drive r1 a base):14002",
        "send": "(send):16003",
    },
    "bay": {
        "px": "(paint x):0",
        "refill": "(refill):1",
        "dx": "(dry x):5001",
        "py": "(paint y):8002",
        "dy": "(dry y):13003",
    },
    "gate": {
        "open": "(open):0",
        "in1": "(carry b1):2001",
        "in2": "(carry b2):2001",
        "close": "(close):8002",
        "arm": "(arm):10003",
    },
    "lamps": {"l1": "(light):0", "m1": "(mend f1):1", "l2": "(light):30001", "m2": "(mend f2):30002"},
}
"""The executor's names for the steps, by domain."""
STEPS = {step: name for names in NAMES.values() for step, name in names.items()}


def wait(name, node="WaitAction"):
    return f'<{node} action="{STEPS[name]}"/>'


def start(name):
    return f"{wait(name, 'WaitAtStartReq')}{wait(name, 'ApplyAtStartEffect')}"


def end(name, check=""):
    execution = f"<ReactiveSequence>{wait(name, 'CheckOverAllReq')}{wait(name, 'ExecuteAction')}</ReactiveSequence>"
    return f"{execution}{check}{wait(name, 'CheckAtEndReq')}{wait(name, 'ApplyAtEndEffect')}"


def step(name):
    return f"<Sequence>{start(name)}{end(name)}</Sequence>"


def seq(*nodes):
    return f"<Sequence>{''.join(step(node) if node in STEPS else node for node in nodes)}</Sequence>"


def par(*nodes, threshold=None):
    inner = "".join(step(node) if node in STEPS else node for node in nodes)
    return f'<Parallel success_threshold="{threshold or len(nodes)}" failure_threshold="1">{inner}</Parallel>'


def tree(inner):
    return f'<root main_tree_to_execute="MainTree">\n<BehaviorTree ID="MainTree">\n{inner}\n</BehaviorTree>\n</root>\n'


def within(name, *nodes, check=None):
    """Nodes while an action goes on; or its end is only applied if another action has ended."""
    return seq(start(name), par(seq(end(name, "" if check is None else wait(check, "CheckAction"))), *nodes))


def limit(name):
    return wait(name, "CheckTimeout")


W = {name: wait(name) for name in STEPS}
CORRECT = {"photos": {
    "one after another": seq("to_a", "to_b", "at_a", "at_b", "merge", "back", "send"),
    "another order": seq("to_b", "at_b", "to_a", "at_a", "back", "merge", "send"),
    "robots in parallel": seq(par(seq("to_a", "at_a"), seq("to_b", "at_b")), par("back", seq("merge", "send"))),
    "waits only": par(
        "to_a", "to_b", seq(W["to_a"], "at_a"), seq(W["to_b"], "at_b"), seq(W["at_a"], "back"),
        seq(W["at_a"], W["at_b"], "merge"), seq(W["merge"], "send"),
    ),
    "layers": seq(par("to_a", "to_b"), par("at_a", "at_b"), par("merge", "back"), "send"),
    "a chain for each robot": par(seq("to_a", "at_a", "back"), seq("to_b", "at_b", W["at_a"], "merge", "send")),
    "merging in the other chain": par(seq("to_a", "at_a", W["at_b"], "merge", "send", "back"), seq("to_b", "at_b")),
    "as the simple builder": par(
        seq("to_a", seq("at_a", par(seq(W["at_b"], "merge", "send"), "back"))), seq("to_b", seq("at_b"))
    ),
    "waiting twice": seq(par("to_a", "to_b"), W["to_a"], W["to_b"], par("at_a", "at_b"), par("merge", "back"), "send"),
    "waiting before all": par(seq(W["to_b"], "to_a", "at_a", "back"), seq("to_b", "at_b", W["back"], "merge", "send")),
    "in nested sequences": seq(seq(seq("to_a", "at_a"), seq("to_b", "at_b")), seq(seq("merge"), seq("send")), "back"),
    "parallels in parallels": seq(par(par(seq("to_a", "at_a"), seq("to_b", "at_b"))), par("merge", "back"), "send"),
    "a drive within another": par(
        seq(start("to_a"), par(seq(end("to_a"), "at_a", "back"), seq("to_b", "at_b"))),
        seq(W["at_a"], W["at_b"], "merge", "send"),
    ),
    "a last check": par(
        seq("to_a", "at_a", "back"), seq("to_b", "at_b", W["at_a"], "merge", "send", wait("at_a", "CheckAction"))
    ),
    "without effects": re.sub("<(Apply|Check|WaitAt)[^>]*>", "", seq(*NAMES["photos"])),
}, "bay": {
    "one part after the other": seq("px", "dx", "refill", "py", "dy"),
    "refilling first": seq("refill", "px", "py", "dx", "dy"),
    "the first dries while the second is painted": seq("refill", "px", par("dx", seq("py", "dy"))),
    "refilling while painting": seq(start("px"), par(seq(end("px"), "dx"), "refill"), "py", "dy"),
    "the other part first": par(seq("py", "dy"), seq(W["py"], "refill", "px", "dx")),
    "limits of time": seq("refill", *(seq(start(p), limit(p), end(p)) for p in ("px", "py", "dx", "dy"))),
}, "gate": {
    "one box after the other": seq("open", "in1", "in2", "close", "arm"),
    "both boxes at once": seq("open", par("in1", "in2"), "close", "arm"),
    "chains that wait for each other": par(seq("open", "in1"), seq(W["open"], "in2", W["in1"], "close", "arm")),
    "all by waits": par(
        seq(W["close"], "arm"), seq(W["in1"], W["in2"], "close"), seq(W["open"], "in1"), seq(W["open"], "in2"), "open"
    ),
    "checks on the way": seq(
        "open", "in1", wait("open", "CheckAction"), "in2", wait("in1", "CheckAction"), "close", "arm"
    ),
}, "lamps": {
    "ends that are checked": seq(within("l1", "m1", check="m1"), within("l2", "m2", check="m2")),
    "within a second": seq(within("l1", "m1"), within("l2", "m2")),
    "all by the first lamp": seq(within("l1", seq("m1", "m2")), "l2"),
    "at once by the first lamp": seq(within("l1", "m1", "m2"), "l2"),
    "the other fuse first": seq(within("l1", "m2", check="m2"), within("l2", "m1", check="m1")),
}}  # fmt: skip
"""By domain; all but those with a lag are proved at any pace."""
WRONG = {"photos": {
    "a photo before the drive": ("over all (at r1 a)", seq("at_a", "to_a", "to_b", "at_b", "merge", "back", "send")),
    "a photo during the drive": (
        "over all (at r1 a)", seq(par("to_a", "at_a"), "to_b", "at_b", "merge", "back", "send")
    ),
    "leaving during the photo": (
        "over all (at r1 a)", par(seq("to_a", par("at_a", "back")), seq("to_b", "at_b", W["at_a"], "merge", "send"))
    ),
    "merging without waiting": (
        "at start (have a)", par(seq("to_a", "at_a", "back"), seq("to_b", "at_b", "merge", "send"))
    ),
    "waiting for the wrong photo": (
        "at start (have a)", par(seq("to_a", "at_a", "back"), seq("to_b", "at_b", W["at_b"], "merge", "send"))
    ),
    "waiting for the drive only": (
        "at start (have a)", par(seq("to_a", "at_a", "back"), seq("to_b", "at_b", W["to_a"], "merge", "send"))
    ),
    "sending before merging": (
        "at start (ready)", seq(par(seq("to_a", "at_a"), seq("to_b", "at_b")), "send", par("merge", "back"))
    ),
    "sending beside merging": (
        "at start (ready)", seq(par(seq("to_a", "at_a"), seq("to_b", "at_b")), par("send", "merge", "back"))
    ),
    "all at once": ("over all (at r1 a)", par("to_a", "to_b", "at_a", "at_b", "merge", "back", "send")),
    "backwards": ("at start (ready)", seq("send", "back", "merge", "at_b", "at_a", "to_b", "to_a")),
}, "bay": {
    "too little paint": ("at start (>= (paint) 3)", seq("px", "py", "refill", "dx", "dy")),
    "one brush for both": ("at start (free)", seq("refill", par("px", "py"), "dx", "dy")),
    "drying what is not painted": ("at start (painted x)", par(seq("px", "refill", "py", "dy"), "dx")),
    "refilling may end as painting starts": ("separation", seq(par(seq("px", "dx"), "refill"), "py", "dy")),
    "painting without waiting for paint": (
        "at start (>= (paint) 3)", par("refill", seq("px", "py", "dy"), seq(W["px"], "dx"))
    ),
    "drying when there is paint": (
        "at start (painted x)", par(seq("refill", "px", "py"), seq(W["refill"], "dx"), seq(W["py"], "dy"))
    ),
    "the last two exchanged": ("at start (painted y)", seq("refill", "px", "dx", "dy", "py")),
}, "gate": {
    "closing beside a box": ("over all (opened)", seq("open", "in1", par("in2", "close"), "arm")),
    "a box before the gate is open": ("over all (opened)", seq("in1", "open", "in2", "close", "arm")),
    "closing waits for one box": ("over all (opened)", par(
        "open", seq(W["open"], "in1"), seq(W["open"], "in2"), seq(W["in1"], "close"), seq(W["close"], "arm")
    )),
    "arming waits for a box": (
        "over all (closed)", par(seq("open", par("in1", "in2"), "close"), seq(W["in2"], "arm"))
    ),
    "a box waits for nothing": ("over all (opened)", par(seq("open", "in1", W["in2"], "close", "arm"), "in2")),
    "closing too early": ("over all (opened)", seq("open", "close", "in1", "in2", "arm")),
    "closing within a box": (
        "over all (opened)", seq("open", "in1", start("in2"), par(seq(end("in2")), "close"), "arm")
    ),
}, "lamps": {
    "the lamp may be out": ("over all (lit)", seq(within("l1", "m1"), within("l2", "m2"))),
    "half a minute late": ("over all (lit)", seq(within("l1", "m1"), within("l2", "m2"))),
    "two in a row, twelve seconds late": ("over all (lit)", seq(within("l1", seq("m1", "m2")), "l2")),
    "in the dark": ("over all (lit)", seq("m1", "l1", within("l2", "m2", check="m2"))),
    "beside the lamp": ("over all (lit)", seq(par("l1", "m1"), within("l2", "m2", check="m2"))),
    "two lamps": ("at start", par(within("l1", "m1", check="m1"), within("l2", "m2", check="m2"))),
    "after the lamp": ("over all (lit)", seq(within("l1", "m1", check="m1"), "l2", "m2")),
    "one of two is checked": ("over all (lit)", seq(within("l1", "m1", "m2", check="m1"), "l2")),
}}  # fmt: skip
"""By domain, with what some execution breaks, maybe besides other things."""
LAGS = {
    "within a second": 1, "all by the first lamp": 1, "at once by the first lamp": 20,
    "half a minute late": 30, "two in a row, twelve seconds late": 12,
}  # fmt: skip
"""How late nodes begin at most, where that is limited."""
FAULTS = {
    "missing": (
        "(drive r1 a base) is not executed, but is 1 step of the plan (n5)",
        seq(par(seq("to_a", "at_a"), seq("to_b", "at_b")), "merge", "send"),
    ),
    "twice": (
        "<tree>:3: ApplyAtStartEffect of (send):16003 a second time (first in line 3)",
        seq(par(seq("to_a", "at_a"), seq("to_b", "at_b")), par("merge", "back"), "send", "send"),
    ),
    "in a circle": (
        "<tree>:3: for ever wait for each other: ",
        par(seq(W["at_b"], "to_a", "at_a", "back"), seq(W["at_a"], "to_b", "at_b", "merge", "send")),
    ),
    "halted": (
        "<tree>:3: Parallel succeeds when 1 of 2 children have: the others are halted",
        seq(par(seq("to_a", "at_a"), seq("to_b", "at_b"), threshold=1), par("merge", "back"), "send"),
    ),
    "waits for nothing": (
        "<tree>:3: for ever wait for each other: ",
        par(seq(W["back"], "to_a", "at_a", "back"), seq("to_b", "at_b", W["at_a"], "merge", "send")),
    ),
    "without an end effect": (
        "<tree>:3: executes (send):16003 without ApplyAtEndEffect: its effects are never applied",
        seq(*list(NAMES["photos"])[:-1], end("send").replace("ApplyAtEndEffect", "CheckAtEndReq")),
    ),
}
"""Trees of photos without an execution of the plan, with the reason."""
