"""Random networks in the formats of other groups, as their programs write them, and whole-number games about them."""

import json
from itertools import product

from tests.stnu.networks import random_network

FORMATS = ("heatlab", "pstnlib", "graphml", "labeled", "text", "cctp")


def rooted(rng, *shape):
    """The links of a random network, some of them from the origin, Z. If a contingent link may end before it starts,
    which is settled before, perhaps before the origin, none are.
    """
    links = random_network(rng, *shape)
    if any(link[4:] and link[2] < 0 for link in links):
        return links
    names = sorted({name for link in links for name in link[:2]})
    for name in rng.sample(names, rng.randint(0, 2)):
        low = rng.choice([None, rng.randint(0, 4)])
        links.append(("Z", name, low, (low or 0) + rng.randint(0, 8)))
    return links


def written(form, links, rng):
    """The text of a network in a format."""
    return {"heatlab": _heatlab, "pstnlib": _pstnlib, "text": _text, "cctp": _cctp}.get(form, _graphml)(
        links, rng, form
    )


def _names(links):
    return list(dict.fromkeys(name for link in links for name in link[:2]))


def _numbered(links):
    names = [name for name in _names(links) if name != "Z"]
    return {"Z": 0} | {name: number for number, name in enumerate(names, start=1)}


def _end(value, sign, rng):
    if value is not None:
        return rng.choice([value, float(value), str(value)])
    infinite = float("inf") * sign
    return rng.choice([infinite, str(infinite), None, "Infinity" if sign > 0 else "-Infinity"])


def _heatlab(links, rng, _form):
    numbers = _numbered(links)
    nodes = [
        {"node_id": number, "owner_id": rng.randint(0, 1), "local_id": number}
        for name, number in numbers.items()
        if name != "Z" or rng.random() < 0.5
    ]
    constraints = []
    for source, target, low, high, *contingent in links:
        constraint = {
            "first_node": numbers[source],
            "second_node": numbers[target],
            "type": "stcu" if contingent else "stc",
            "min_duration": _end(low, -1, rng),
            "max_duration": _end(high, 1, rng),
        }
        if contingent and rng.random() < 0.5:
            constraint["distribution"] = {"name": f"U_{low}_{high}", "type": "Empirical"}
            if rng.random() < 0.5 and low >= 0:
                constraint |= {"type": "pstc", "min_duration": 0.0 if low else low, "max_duration": float("inf")}
        of_domain = not contingent and source == "Z" and rng.random() < 0.5
        node = next((node for node in nodes if node["node_id"] == numbers[target]), {})
        if of_domain and "min_domain" not in node:
            node |= {"min_domain": _end(low, -1, rng), "max_domain": _end(high, 1, rng)}
        else:
            constraints.append(constraint)
    if not constraints:
        constraints.append({"first_node": 1, "second_node": 1, "type": "stc", "min_duration": 0, "max_duration": 0})
    return json.dumps({"num_agents": 2, "nodes": nodes, "constraints": constraints})


def _pstnlib(links, rng, _form):
    numbers = _numbered(links)
    points = [{"id": number, "label": name, "controllable": True} for name, number in numbers.items()]
    constraints = [
        {
            "source": numbers[source],
            "sink": numbers[target],
            "label": f"{source}-{target}",
            "type": "stcu" if contingent else "stc",
            rng.choice(["duration_bound", "intervals"]): {"lb": _end(low, -1, rng), "ub": _end(high, 1, rng)},
        }
        for source, target, low, high, *contingent in links
    ]
    return json.dumps({"name": "n", rng.choice(["timepoints", "time_points"]): points, "constraints": constraints})


def _text(links, rng, _form):
    edges, contingents = [], []
    for source, target, low, high, *contingent in links:
        if contingent:
            contingents.append(f"{source} {low} {high} {target}")
            continue
        edges += [] if high is None else [f"{source} {high} {target}"]
        edges += [] if low is None else [f"{target} {-low} {source}"]
    names = _names(links)
    lines = ["# KIND OF NETWORK", rng.choice(["STNU", "stnu"]), "# Num Time-Points", str(len(names))]
    lines += ["# Num Ordinary Edges", str(len(edges)), "# Num Contingent Links", str(len(contingents))]
    lines += ["# Time-Point Names", " ".join(names), "# Ordinary Edges", *edges, "# Contingent Links", *contingents]
    return "\n".join(lines)


def _cctp(links, rng, _form):
    numbers = {name: f"e{number}" for number, name in enumerate(_names(links))}
    events = [f"<EVENT><ID>{key}</ID><NAME>{name}</NAME></EVENT>" for name, key in numbers.items()]
    parts = [*events, *(cctp_constraint(numbers, link, "") for link in links)]
    start = f"<START-EVENT>{numbers['Z']}</START-EVENT>" if "Z" in numbers else ""
    return f"<?xml version='1.0'?>\n<CCTP><NAME>n</NAME>{start}{''.join(parts)}</CCTP>"


def cctp_constraint(numbers, link, guard):
    source, target, low, high, *contingent = link
    bounds = "" if low is None else f"<LOWERBOUND>{low}</LOWERBOUND>"
    bounds += f"<UPPERBOUND>{'inf' if high is None else high}</UPPERBOUND>"
    kind = "Uncontrollable;Bounded" if contingent else "Controllable"
    return (
        f"<CONSTRAINT><START>{numbers[source]}</START><END>{numbers[target]}</END>{bounds}<TYPE>{kind}</TYPE>"
        f"<RELAXABLE-LB>T</RELAXABLE-LB>{guard}</CONSTRAINT>"
    )


def _graphml(links, rng, form):
    empty = {name: {} for name in _names(links)}
    labeled = [((source, target, low, high, *more), {}) for source, target, low, high, *more in links]
    return graphml_of(empty, labeled, {}, rng, plain=form == "graphml")


def graphml_of(nodes, links, observed, rng, *, plain=False):
    """As the CSTNU tool writes networks: of nodes with labels and links with labels."""

    def literals(label):
        return "".join(f"{'' if value else '¬'}{name}" for name, value in label.items()) or "⊡"

    lines = ['<?xml version="1.0" encoding="UTF-8"?>', '<graphml><graph edgedefault="directed">']
    of_node = {node: name for name, node in observed.items()}
    for name, label in nodes.items():
        obs = f'<data key="Obs">{of_node[name]}</data>' if name in of_node else ""
        said = "" if plain else f'<data key="Label">{literals(label)}</data>'
        lines.append(f'<node id="{name}">{obs}{said}</node>')
    values, cases = {}, []
    for (source, target, low, high, *contingent), label in links:
        if contingent:
            cases.append((source, target, low, high, label))
            continue
        if high is not None:
            values.setdefault((source, target), []).append((high, label))
        if low is not None:
            values.setdefault((target, source), []).append((-low, label))

    def edge(source, target, kind, *data):
        body = "".join(f'<data key="{key}">{text}</data>' for key, text in data)
        number = len(lines)
        lines.append(
            f'<edge id="e{number}" source="{source}" target="{target}"><data key="Type">{kind}</data>{body}</edge>'
        )

    for (source, target), pairs in values.items():
        if plain:
            for value, _ in pairs:
                edge(source, target, "requirement", ("Value", value))
        else:
            inside = " ".join(f"({value}, {literals(label)})" for value, label in pairs)
            edge(source, target, "requirement", ("LabeledValues", f"{{{inside} }}"))
    _contingent_edges(cases, edge, rng, literals, plain)
    names = list(nodes)
    if len(names) > 1 and rng.random() < 0.3:
        edge(names[0], names[1], "derived", ("LabeledValues", "{(-99, ¿p)}"))
    return "\n".join([*lines, "</graph></graphml>"])


def _contingent_edges(cases, edge, rng, literals, plain):
    for source, target, low, high, label in cases:
        if plain and rng.random() < 0.5 and 0 <= low <= high and high > 0:
            edge(source, target, "contingent", ("Value", high))
            edge(target, source, "contingent", ("Value", -low))
        elif plain:
            edge(source, target, "contingent", ("LabeledValue", f"LC({target}):{low}"))
            edge(target, source, "contingent", ("LabeledValue", f"UC({target}):{-high}"))
        else:
            one, other = (f"{{({target}, {end}, {literals(label)}) }}" for end in (low, -high))
            edge(source, target, "contingent", ("LowerCaseLabeledValues", one))
            edge(target, source, "contingent", ("UpperCaseLabeledValues", other))


# -- networks with observations ----------------------------------------------------------------------------------------


def random_conditional(rng):
    """Nodes with labels, links with labels, and where propositions are observed; everything is over by a deadline."""
    observed = {name: f"{name.upper()}?" for name in "pq"[: rng.choice([1, 1, 2])]}
    nodes = {"Z": {}, **{node: {} for node in observed.values()}}
    if len(observed) == 2 and rng.random() < 0.3:
        nodes["Q?"] = {"p": rng.random() < 0.5}

    def label(chance):
        drawn = {name: rng.random() < 0.5 for name in observed if rng.random() < chance}
        for name in list(drawn):
            for other, value in nodes[observed[name]].items():
                drawn[other] = value
        return drawn

    nodes |= {name: label(0.3) for name in ("X", "Y")}
    links, deadline = [], rng.randint(2, 6)
    if rng.random() < 0.6:
        low = rng.randint(0, 2)
        source = rng.choice(["Z", "X", "P?"])
        nodes["C"] = dict(nodes[source])
        links.append(((source, "C", low, low + rng.randint(0, 2), "contingent"), nodes["C"]))
    for name, own in nodes.items():
        if name not in {"Z", "C"}:
            links.append((("Z", name, 0, deadline), own))
            for variable in own:
                links.append(((observed[variable], name, 0, None), own))
    for _ in range(rng.randint(2, 5)):
        source, target = rng.sample(sorted(nodes), 2)
        low = rng.choice([None, rng.randint(-2, deadline)])
        high = None if low is not None and rng.random() < 0.6 else max(low or 0, rng.randint(-2, deadline))
        joint = {**nodes[source], **nodes[target], **label(0.5)}
        if all(joint[name] == value for each in (source, target) for name, value in nodes[each].items()):
            links.append(((source, target, low, high), joint))
    return nodes, links, observed, deadline + 5


class WholeNumbers:
    """Whether an executive who moves in whole units of time, and sees what is observed at once, meets all requirements
    whatever nature does; several moves at one moment come one after the other.
    """

    def __init__(self, nodes, links, observed, horizon):
        self.nodes, self.observed, self.horizon = nodes, observed, horizon
        self.natural = {link[1]: link for link, _ in links if link[4:]}
        self.demands = [(link, label) for link, label in links if not link[4:]]
        self.memo = {}

    def controllable(self):
        return self._revealed(["Z"], {}, {}, 0)

    def _holds(self, label, values):
        if any(values.get(name, value) != value for name, value in label.items()):
            return False
        return True if all(name in values for name in label) else None

    def _broken(self, times, values, now):
        for (source, target, low, high), label in self.demands:
            if not self._holds(label, values):
                continue
            if source in times and target in times:
                apart = times[target] - times[source]
                if (low is not None and apart < low) or (high is not None and apart > high):
                    return True
            late = source in times and high is not None and now - times[source] > high
            if target not in times and late:
                return True
            if source not in times and target in times and low is not None and now - times[target] > -low:
                return True
        return now > self.horizon

    def _act(self, times, values, now):
        key = (frozenset(times.items()), frozenset(values.items()), now)
        if key not in self.memo:
            self.memo[key] = not self._broken(times, values, now) and self._moves(times, values, now)
        return self.memo[key]

    def _moves(self, times, values, now):
        open_nodes = [
            x for x, label in self.nodes.items() if x not in times and self._holds(label, values) is not False
        ]
        if not open_nodes:
            return True
        for node in open_nodes:
            may = node not in self.natural and self._holds(self.nodes[node], values)
            if may and self._revealed([node], times, values, now):
                return True
        return self._nature(times, values, now + 1)

    def _revealed(self, happening, times, values, now):
        """Whether the executive wins after these, whatever is observed, and with links of no length ending at once."""
        times = times | dict.fromkeys(happening, now)
        names = [name for name, node in self.observed.items() if node in happening]
        ending = [end for end, link in self.natural.items() if link[0] in happening and link[2] == 0]
        for given in product((True, False), repeat=len(names)):
            known = values | dict(zip(names, given, strict=True))
            for ends in product((True, False), repeat=len(ending)):
                at_once = [end for end, ended in zip(ending, ends, strict=True) if ended or self.natural[end][3] == 0]
                if not (self._revealed(at_once, times, known, now) if at_once else self._act(times, known, now)):
                    return False
        return True

    def _nature(self, times, values, now):
        running = [
            (end, now - times[link[0]] >= link[3])
            for end, link in self.natural.items()
            if link[0] in times and end not in times and now - times[link[0]] >= link[2]
        ]
        for ended in product(*((True,) if must else (True, False) for _, must in running)):
            ends = [end for (end, _), done in zip(running, ended, strict=True) if done]
            if not (self._revealed(ends, times, values, now) if ends else self._act(times, values, now)):
                return False
        return True
