"use strict";
// What is decided about a point, with fractions of whole numbers without limit: no rounding takes part in a verdict.
// There is nothing of a browser here; drawings alone turn fractions into numbers.

const Exact = (() => {
  const absolute = (a) => (a < 0n ? -a : a);
  const gcd = (a, b) => {
    while (b) [a, b] = [b, a % b];
    return absolute(a);
  };
  const lcm = (a, b) => absolute(a * b) / gcd(a, b);

  // -- fractions ---------------------------------------------------------------------------------------------------

  const fraction = (n, d = 1n) => {
    if (d === 0n) throw new RangeError("division by zero");
    const g = gcd(n, d) * (d < 0n ? -1n : 1n);
    return { n: n / g, d: d / g };
  };
  const ZERO = { n: 0n, d: 1n };
  const ONE = { n: 1n, d: 1n };
  const add = (a, b) => fraction(a.n * b.d + b.n * a.d, a.d * b.d);
  const subtract = (a, b) => fraction(a.n * b.d - b.n * a.d, a.d * b.d);
  const multiply = (a, b) => fraction(a.n * b.n, a.d * b.d);
  const divide = (a, b) => fraction(a.n * b.d, a.d * b.n);
  const compare = (a, b) => {
    const difference = a.n * b.d - b.n * a.d;
    return difference < 0n ? -1 : difference > 0n ? 1 : 0;
  };
  const NUMBER = /^([+-]?)(?:(\d+)\/(\d+)|(\d*)\.?(\d*)(?:[eE]([+-]?\d{1,3}))?)$/;

  /** The value of `3`, `-0.25`, `1e-3` or `1/3`; null for anything else, or what is too long. */
  const parse = (text) => {
    const match = NUMBER.exec(text.trim());
    if (!match || text.length > 300) return null;
    const [, sign, above, below, whole, part, power] = match;
    const one = sign === "-" ? -1n : 1n;
    if (below !== undefined) return BigInt(below) === 0n ? null : fraction(one * BigInt(above), BigInt(below));
    if (!whole && !part) return null;
    const exponent = Number(power || 0) - part.length;
    const digits = one * BigInt(whole + part);
    return exponent < 0 ? fraction(digits, 10n ** BigInt(-exponent)) : fraction(digits * 10n ** BigInt(exponent));
  };

  /** The shortest exact text: a decimal where that is finite, otherwise a fraction. */
  const text = (value) => {
    let [rest, twos, fives] = [value.d, 0, 0];
    while (rest % 2n === 0n) [rest, twos] = [rest / 2n, twos + 1];
    while (rest % 5n === 0n) [rest, fives] = [rest / 5n, fives + 1];
    const sign = value.n < 0n ? "-" : "";
    if (rest !== 1n) return `${value.n}/${value.d}`;
    const places = Math.max(twos, fives);
    const digits = ((absolute(value.n) * 10n ** BigInt(places)) / value.d).toString().padStart(places + 1, "0");
    return places ? `${sign}${digits.slice(0, -places)}.${digits.slice(-places)}` : `${sign}${digits}`;
  };

  /** The exact text where it is short, otherwise an approximation that says so. */
  const readable = (value) => {
    const exact = text(value);
    return (exact.length <= 9 ? exact : `≈${parseFloat(number(value).toPrecision(6))}`).replace("-", "−");
  };

  /** For the eye only. */
  const number = (value) => {
    const scale = 10n ** 18n;
    const whole = value.n / value.d;
    return Number(whole) + Number(((value.n % value.d) * scale) / value.d) / Number(scale);
  };

  // -- what Python has written ---------------------------------------------------------------------------------------

  /** A constraint with whole numbers: Σ factors × parameters, relation, constant. */
  const constraintOf = (written, index) => {
    const terms = Object.entries(written.coefficients).map(([name, factor]) => [index.get(name), parse(factor)]);
    const constant = parse(written.constant);
    const unit = terms.reduce((sofar, [, factor]) => lcm(sofar, factor.d), constant.d);
    const whole = (value) => value.n * (unit / value.d);
    return {
      terms: terms.map(([at, factor]) => [at, whole(factor)]),
      relation: written.relation,
      constant: whole(constant),
    };
  };

  const optional = (written) => (written === null ? null : parse(written));

  /** The document that a page holds, with fractions for texts; `index` finds parameters by name. */
  const read = (written) => {
    const index = new Map(written.parameters.map((one, at) => [one.name, at]));
    const polyhedron = (constraints) => constraints.map((one) => constraintOf(one, index));
    const bound = (one) =>
      one === null
        ? null
        : {
            constant: parse(one.constant),
            terms: Object.entries(one.coefficients).map(([name, factor]) => [index.get(name), parse(factor)]),
          };
    return {
      ...written,
      index,
      parameters: written.parameters.map((one) => ({
        ...one,
        nominal: parse(one.nominal),
        lower: optional(one.lower),
        upper: optional(one.upper),
        first: parse(one.first),
        step: parse(one.step),
      })),
      region: written.region && {
        base: written.region.base && polyhedron(written.region.base),
        pieces: written.region.pieces.map(polyhedron),
      },
      boxes: written.boxes.map((box) => ({
        ...box,
        intervals: written.parameters.map(({ name }) => ({
          ...box.intervals[name],
          lower: optional(box.intervals[name].lower),
          upper: optional(box.intervals[name].upper),
        })),
      })),
      network: written.network.map((one) => ({ ...one, lower: bound(one.lower), upper: bound(one.upper) })),
      obligations: written.obligations.map((one) => ({ ...one, pieces: one.pieces.map(polyhedron) })),
    };
  };

  // -- membership ----------------------------------------------------------------------------------------------------

  /** The point over one denominator, so that constraints are sums of whole numbers. */
  const scaled = (point) => {
    const unit = point.reduce((sofar, value) => lcm(sofar, value.d), 1n);
    return { unit, values: point.map((value) => value.n * (unit / value.d)) };
  };

  const holds = (constraint, { unit, values }) => {
    const total = constraint.terms.reduce((sum, [at, factor]) => sum + factor * values[at], 0n);
    const limit = constraint.constant * unit;
    return constraint.relation === "<=" ? total <= limit : constraint.relation === "<" ? total < limit : total === limit;
  };

  const isIn = (polyhedron, place) => polyhedron.every((constraint) => holds(constraint, place));

  const isInRegion = (region, point) => {
    const place = scaled(point);
    const some = region.pieces.some((piece) => isIn(piece, place));
    return region.base === null ? some : isIn(region.base, place) && !some;
  };

  const isInInterval = ({ lower, upper, lower_closed, upper_closed }, value) => {
    const above = lower === null ? 1 : compare(value, lower);
    const below = upper === null ? 1 : compare(upper, value);
    return (above > 0 || (above === 0 && lower_closed)) && (below > 0 || (below === 0 && upper_closed));
  };

  const isInBox = (box, point) => box.intervals.every((interval, at) => isInInterval(interval, point[at]));

  // -- schedules -----------------------------------------------------------------------------------------------------

  const valueOf = (bound, point) =>
    bound.terms.reduce((sum, [at, factor]) => add(sum, multiply(factor, point[at])), bound.constant);

  /** The earliest time of each time point, by its number (0 is the beginning); or statements that contradict. */
  const earliest = (model, point) => {
    const edges = [];
    model.network.forEach((one, statement) => {
      if (one.lower !== null) edges.push({ from: one.source, to: one.target, least: valueOf(one.lower, point), statement });
      if (one.upper !== null) {
        const least = subtract(ZERO, valueOf(one.upper, point));
        edges.push({ from: one.target, to: one.source, least, statement });
      }
    });
    const unit = edges.reduce((sofar, edge) => lcm(sofar, edge.least.d), 1n);
    for (const edge of edges) edge.whole = edge.least.n * (unit / edge.least.d);
    const times = new Array(model.points).fill(0n);
    const arrival = new Array(model.points).fill(null);
    for (let round = 0; round <= model.points; round += 1) {
      let moved = null;
      for (const edge of edges) {
        if (times[edge.from] + edge.whole > times[edge.to]) {
          times[edge.to] = times[edge.from] + edge.whole;
          arrival[edge.to] = edge;
          moved = edge.to;
          if (edge.to === 0) return { times: null, contradiction: cycleAt(arrival, 0) };
        }
      }
      if (moved === null) return { times: times.map((time) => fraction(time, unit)), contradiction: null };
      // What moves even now has been reached by a way that is longer than there are time points.
      if (round === model.points) return { times: null, contradiction: cycleAt(arrival, moved) };
    }
    return null;
  };

  /** The statements of the cycle that is met on the way back from a time point. */
  const cycleAt = (arrival, start) => {
    const seen = new Map();
    const path = [];
    let place = start;
    while (!seen.has(place) && arrival[place] !== null) {
      seen.set(place, path.length);
      path.push(arrival[place]);
      place = arrival[place].from;
    }
    // Where nothing arrives, a time point is as early as can be: not before the beginning.
    const cycle = seen.has(place) ? path.slice(seen.get(place)) : path;
    return [...new Set(cycle.reverse().map((edge) => edge.statement))];
  };

  // -- verdicts --------------------------------------------------------------------------------------------------------

  /**
   * Where the way from one point to another comes into a polyhedron: the least share of it, and whether the polyhedron
   * is `open` there, so that it holds only what is beyond; null if it never does.
   */
  const entered = (polyhedron, from, to) => {
    let [low, high] = [ZERO, ONE];
    let [lowOpen, highOpen] = [false, false];
    const [start, end] = [scaled(from), scaled(to)];
    const slack = (constraint, { unit, values }) =>
      fraction(constraint.terms.reduce((sum, [at, factor]) => sum + factor * values[at], 0n) - constraint.constant * unit, unit);
    for (const constraint of polyhedron) {
      const [first, last] = [slack(constraint, start), slack(constraint, end)];
      const speed = subtract(last, first);
      const open = constraint.relation === "<";
      for (const sign of constraint.relation === "=" ? [1n, -1n] : [1n]) {
        const [at, rate] = [fraction(first.n * sign, first.d), fraction(speed.n * sign, speed.d)];
        if (rate.n === 0n) {
          if (at.n > 0n || (at.n === 0n && open)) return null;
          continue;
        }
        const share = divide(fraction(-at.n, at.d), rate);
        if (rate.n < 0n && compare(share, low) >= 0) [low, lowOpen] = [share, open || (lowOpen && !compare(share, low))];
        if (rate.n > 0n && compare(share, high) <= 0) [high, highOpen] = [share, open || (highOpen && !compare(share, high))];
      }
    }
    const order = compare(low, high);
    return order < 0 || (order === 0 && !lowOpen && !highOpen) ? { share: low, open: lowOpen } : null;
  };

  /** The parameters that are outside their declared bounds. */
  const isBeyond = (model, point) =>
    model.parameters.flatMap(({ lower, upper }, at) =>
      (lower !== null && compare(point[at], lower) < 0) || (upper !== null && compare(point[at], upper) > 0) ? [at] : [],
    );

  /**
   * What is known of a point. `valid` is true, false, or null where it is not known; `why` says what decided: `bounds`
   * (with the parameters), `network` (with statements that contradict each other), `obligations`, or `boxes`.
   * `broken` are the obligations that some schedule breaks there, that first which breaks first on the straight way
   * from the plan's own values, with the share of the way, and whether it holds there and breaks only beyond (`open`);
   * null, in the order of examination, where that has no meaning or is not known, as not all was examined.
   */
  const judge = (model, point) => {
    const boxes = model.boxes.map((box) => isInBox(box, point));
    const beyond = isBeyond(model, point);
    const schedule = earliest(model, point);
    const known = { boxes, beyond, times: schedule.times, contradiction: schedule.contradiction, broken: [] };
    if (beyond.length) return { ...known, valid: false, why: "bounds" };
    if (schedule.times === null) return { ...known, valid: false, why: "network" };
    if (model.region === null) return { ...known, valid: boxes.some(Boolean) ? true : null, why: "boxes" };
    if (isInRegion(model.region, point)) return { ...known, valid: true, why: "obligations" };
    return { ...known, valid: false, why: "obligations", broken: breaking(model, point) };
  };

  // Where no bound, demand or statement of the network excludes the plan's own values nor the point, none excludes what
  // is between them, because what they admit is convex: there the pieces of an obligation mean what they say.
  const breaking = (model, point) => {
    const from = model.parameters.map(({ nominal }) => nominal);
    const brokenAt = (place) => model.obligations.flatMap(({ pieces }, at) => (pieces.some((piece) => isIn(piece, place)) ? [at] : []));
    const demanded = (found) => found.filter((at) => model.obligations[at].demand);
    const start = scaled(from);
    const fair = model.complete && !isBeyond(model, from).length && earliest(model, from).times !== null && !demanded(brokenAt(start)).length;
    const all = brokenAt(scaled(point));
    const entry = (at) => model.obligations[at].pieces.map((piece) => entered(piece, from, point)).filter(Boolean)
      .sort(byEntry)[0];
    const found = (demanded(all).length ? demanded(all) : all).map((at) => ({ at, ...(fair ? entry(at) : { share: null }) }));
    return fair ? found.sort((one, other) => byEntry(one, other) || one.at - other.at) : found;
  };

  const byEntry = (one, other) => compare(one.share, other.share) || one.open - other.open;

  // -- slices ----------------------------------------------------------------------------------------------------------

  /** A convex polygon of points [x, y], cut by `a x + b y ≤ c`. */
  const cut = (polygon, a, b, c) => {
    const excess = polygon.map(([x, y]) => subtract(add(multiply(a, x), multiply(b, y)), c));
    return polygon.flatMap((corner, at) => {
      const next = (at + 1) % polygon.length;
      const [here, there] = [excess[at], excess[next]];
      const kept = here.n <= 0n ? [corner] : [];
      if ((here.n < 0n && there.n > 0n) || (here.n > 0n && there.n < 0n)) {
        const share = divide(here, subtract(here, there));
        const between = (axis) => add(corner[axis], multiply(share, subtract(polygon[next][axis], corner[axis])));
        kept.push([between(0), between(1)]);
      }
      return kept;
    });
  };

  /** The closure of a polyhedron in the plane of two parameters through a point, within a rectangle of corners. */
  const slice = (polyhedron, point, [across, up], view) => {
    let polygon = view;
    for (const constraint of polyhedron) {
      let [a, b, c] = [ZERO, ZERO, fraction(constraint.constant)];
      for (const [at, factor] of constraint.terms) {
        if (at === across) a = fraction(factor);
        else if (at === up) b = fraction(factor);
        else c = subtract(c, multiply(fraction(factor), point[at]));
      }
      if (a.n === 0n && b.n === 0n) {
        const fits = constraint.relation === "=" ? c.n === 0n : constraint.relation === "<" ? c.n > 0n : c.n >= 0n;
        if (!fits) return [];
        continue;
      }
      polygon = cut(polygon, a, b, c);
      if (constraint.relation === "=") {
        const negated = (value) => fraction(-value.n, value.d);
        polygon = cut(polygon, negated(a), negated(b), negated(c));
      }
      if (!polygon.length) return [];
    }
    return polygon;
  };

  return {
    ZERO, ONE, fraction, add, subtract, multiply, divide, compare, parse, text, readable, number,
    read, isInRegion, isInBox, isInInterval, earliest, judge, byEntry, slice,
  };
})();

if (typeof module !== "undefined") module.exports = Exact;
