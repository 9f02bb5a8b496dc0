"use strict";
// The page of a comparison: what is on it follows the values of the parameters. Decisions are those of exact.js.

(() => {
  const byId = (id) => document.getElementById(id);
  const model = Exact.read(JSON.parse(byId("data").textContent));
  const state = {
    point: model.parameters.map(({ nominal }) => nominal),
    axes: model.parameters.length > 1 ? [0, 1] : [0, -1],
  };
  const SVG = "http://www.w3.org/2000/svg";

  const element = (name, attributes = {}, ...content) => {
    const made = document.createElement(name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    made.append(...content);
    return made;
  };
  const drawn = (name, attributes, ...content) => {
    const made = document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    made.append(...content);
    return made;
  };
  const nominal = () => model.parameters.map((one) => one.nominal);
  const same = (one, other) => one.every((value, at) => Exact.compare(value, other[at]) === 0);

  // -- sliders -------------------------------------------------------------------------------------------------------

  /** The value of a position, and the position nearest to a value. */
  const valueAt = (one, position) => Exact.add(one.first, Exact.multiply(one.step, Exact.fraction(BigInt(position))));
  const positionOf = (one, value) => {
    const place = Math.round(Exact.number(Exact.divide(Exact.subtract(value, one.first), one.step)));
    return Math.min(one.steps, Math.max(0, place));
  };

  const sliders = model.parameters.map((one, at) => {
    const range = element("input", { type: "range", min: 0, max: one.steps, step: 1, id: `range-${at}` });
    const typed = element("input", { type: "text", id: `value-${at}`, spellcheck: "false", autocomplete: "off",
      "aria-label": `exact value of ${one.words}`, "aria-describedby": `error-${at}` });
    const error = element("p", { class: "error", id: `error-${at}`, role: "status" });
    const name = one.words.includes(one.name) ? [] : [" ", element("code", {}, one.name)];
    const label = element("label", { for: `range-${at}` }, one.words, ...name);
    byId("sliders").append(element("div", { class: "slider" }, label, element("div", { class: "row" }, range, typed), error));
    const moved = () => {
      state.point[at] = valueAt(one, range.value);
      typed.value = Exact.text(state.point[at]);
      accept();
      changed();
    };
    const accept = () => {
      typed.setAttribute("aria-invalid", "false");
      error.textContent = "";
      range.setAttribute("aria-valuetext", Exact.readable(state.point[at]));
    };
    range.addEventListener("input", moved);
    typed.addEventListener("input", () => {
      const value = Exact.parse(typed.value);
      if (value === null) {
        typed.setAttribute("aria-invalid", "true");
        error.textContent = `Expected a number such as 5, -0.25, 1e-3 or 1/3; still at ${Exact.text(state.point[at])}.`;
        return;
      }
      state.point[at] = value;
      range.value = positionOf(one, value);
      accept();
      changed();
    });
    return {
      show: () => {
        range.value = positionOf(one, state.point[at]);
        typed.value = Exact.text(state.point[at]);
        accept();
      },
    };
  });

  const move = (values) => {
    state.point = values;
    sliders.forEach((slider) => slider.show());
    changed();
  };
  byId("reset").addEventListener("click", () => move(nominal()));

  // -- the verdict -----------------------------------------------------------------------------------------------------

  const list = (texts) => element("ul", {}, ...texts.map((text) => element("li", {}, text)));
  const paragraph = (text) => element("p", {}, text);

  const reasons = (judged) => {
    const said = [];
    if (judged.why === "bounds") {
      said.push(paragraph("Outside the declared bounds:"), list(judged.beyond.map((at) => {
        const { words, lower, upper } = model.parameters[at];
        const ends = [lower && `at least ${Exact.text(lower)}`, upper && `at most ${Exact.text(upper)}`];
        return `${words} is declared as ${ends.filter(Boolean).join(" and ")}`;
      })));
    } else if (judged.why === "network") {
      const statements = judged.contradiction.map((at) => model.network[at].words);
      said.push(paragraph("There is no schedule: these cannot all hold, nor begin before time 0."), list(statements));
    } else if (judged.valid === false && judged.broken.length) {
      const isFirst = (one) => one.share !== null && Exact.byEntry(one, judged.broken[0]) === 0;
      const named = (found) => found.map(({ at }) => model.obligations[at].words);
      const first = named(judged.broken.filter(isFirst));
      const others = named(judged.broken.filter((one) => !isFirst(one)));
      if (first.length) said.push(paragraph("Breaks first:"), list(first), element("p", { class: "note" }, wayTo(judged.broken[0])));
      if (others.length) said.push(paragraph(first.length ? "Can break as well:" : "Can break:"), list(others));
    } else if (judged.valid === false) {
      said.push(paragraph("Some schedule of the plan breaks an obligation; which one was not found out."));
    } else if (judged.valid === null) {
      said.push(paragraph("In none of the boxes; the exact envelope is not in this page."));
    }
    const names = model.boxes.filter((_, at) => judged.boxes[at]).map(({ method }) => method);
    if (model.boxes.length) said.push(element("p", { class: "note" }, `In the box of: ${names.join(", ") || "no method"}.`));
    if (judged.broken.length && !model.complete) {
      said.push(element("p", { class: "note" }, "Not all obligations were examined; others may break, too."));
    }
    return said;
  };

  /** Where on the straight way from the plan's values the first obligation breaks. */
  const wayTo = ({ share, open }) => {
    if (share.n === 0n) {
      return open ? "At the plan’s own values it holds; in this direction it breaks with any change." : "It breaks at the plan’s own values already.";
    }
    const from = nominal();
    const values = from.map((value, at) => Exact.add(value, Exact.multiply(share, Exact.subtract(state.point[at], value))));
    const moved = model.parameters.flatMap(({ words }, at) =>
      Exact.compare(from[at], state.point[at]) === 0 ? [] : [`${words} = ${Exact.readable(values[at])}`],
    );
    const way = "Nothing else that breaks here breaks earlier on the straight way from the plan’s values:";
    return `${way} ${open ? "it breaks just beyond" : "it breaks at"} ${moved.join(", ")}.`;
  };

  const showVerdict = (judged) => {
    const [kind, text] = judged.valid === null ? ["unknown", "? Not known"] :
      judged.valid ? ["valid", "✓ Valid: every schedule that the plan allows works"] : ["invalid", "✗ Not valid: the plan can fail"];
    byId("verdict").className = kind;
    byId("mark").textContent = text + (same(state.point, nominal()) ? " (at the plan’s values)" : "");
    byId("reason").replaceChildren(...reasons(judged));
  };

  // -- the slice ---------------------------------------------------------------------------------------------------------

  const ends = (at) => [model.parameters[at].first, valueAt(model.parameters[at], model.parameters[at].steps)];

  const ticks = (low, high, count) => {
    const rough = (high - low) / count;
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((factor) => factor * power).find((one) => one >= rough);
    const first = Math.ceil(low / step - 1e-9);
    return Array.from({ length: Math.max(0, Math.floor(high / step + 1e-9) - first + 1) }, (_, k) => (first + k) * step);
  };
  const label = (value) => String(parseFloat(value.toPrecision(6))).replace("-", "−");

  const boxAsConstraints = (box) => box.intervals.flatMap(({ lower, upper, lower_closed, upper_closed }, at) => [
    ...(lower === null ? [] : [{ terms: [[at, -lower.d]], relation: lower_closed ? "<=" : "<", constant: -lower.n }]),
    ...(upper === null ? [] : [{ terms: [[at, upper.d]], relation: upper_closed ? "<=" : "<", constant: upper.n }]),
  ]);
  const boxConstraints = model.boxes.map(boxAsConstraints);

  const showSlice = () => {
    const svg = byId("slice");
    const [across, up] = state.axes;
    const flat = up < 0;
    const width = Math.max(240, svg.clientWidth);
    const height = flat ? 130 : Math.min(Math.round(width * 0.72), 560);
    const margin = { left: flat ? 12 : 56, right: 12, top: 10, bottom: 34 };
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    svg.setAttribute("height", height);
    const [low, high] = ends(across);
    const [bottom, top] = flat ? [Exact.ZERO, Exact.ONE] : ends(up);
    const scale = (value, from, to, first, last) => first + ((value - from) / (to - from)) * (last - first);
    const [x0, x1, y0, y1] = [low, high, bottom, top].map(Exact.number);
    const toX = (value) => scale(value, x0, x1, margin.left, width - margin.right);
    const toY = (value) => scale(value, y0, y1, height - margin.bottom, margin.top);
    const view = [[low, bottom], [high, bottom], [high, top], [low, top]];
    const shape = (constraints, attributes) => {
      const polygon = Exact.slice(constraints, state.point, [across, flat ? -2 : up], view);
      if (!polygon.length) return [];
      const points = polygon.map(([x, y]) => `${toX(Exact.number(x)).toFixed(2)},${toY(Exact.number(y)).toFixed(2)}`);
      return [drawn("polygon", { points: points.join(" "), ...attributes })];
    };
    const frame = { x: margin.left, y: margin.top, width: width - margin.left - margin.right, height: height - margin.top - margin.bottom };
    const inside = drawn("g", { "clip-path": "url(#view)" }, drawn("rect", { ...frame, fill: "url(#bad)" }));
    if (model.region) {
      if (model.region.base) {
        inside.append(...shape(model.region.base, { class: "region-valid" }));
        for (const piece of model.region.pieces) inside.append(...shape(piece, { class: "region-bad", fill: "url(#bad)" }));
      } else {
        for (const piece of model.region.pieces) inside.append(...shape(piece, { class: "region-valid" }));
      }
    } else {
      for (const box of boxConstraints) inside.append(...shape(box, { class: "region-valid" }));
    }
    boxConstraints.forEach((constraints, at) => {
      const found = shape(constraints, { class: `box box-${at % 4}` });
      inside.append(...found);
      byId(`box-${at}`).textContent = found.length ? "" : " (not in this slice)";
    });
    const dot = (point, attributes, size) => {
      const [x, y] = [toX(Exact.number(point[across])), flat ? (height - margin.bottom + margin.top) / 2 : toY(Exact.number(point[up]))];
      return [
        drawn("path", { d: `M${x - size} ${y}H${x + size}M${x} ${y - size}V${y + size}`, ...attributes }),
        drawn("circle", { cx: x, cy: y, r: size * 0.6, ...attributes }),
      ];
    };
    inside.append(dot(nominal(), { class: "nominal" }, 7)[1], ...dot(state.point, { class: "point" }, 9));
    const axes = drawn("g", {}, drawn("rect", { ...frame, class: "frame" }));
    for (const value of ticks(x0, x1, Math.max(3, width / 110))) {
      axes.append(drawn("line", { x1: toX(value), x2: toX(value), y1: height - margin.bottom, y2: height - margin.bottom + 4, class: "frame" }));
      axes.append(drawn("text", { x: toX(value), y: height - margin.bottom + 18, "text-anchor": "middle" }, label(value)));
    }
    for (const value of flat ? [] : ticks(y0, y1, 6)) {
      axes.append(drawn("line", { x1: margin.left - 4, x2: margin.left, y1: toY(value), y2: toY(value), class: "frame" }));
      axes.append(drawn("text", { x: margin.left - 8, y: toY(value) + 4, "text-anchor": "end" }, label(value)));
    }
    const bad = drawn("pattern", { id: "bad", width: 7, height: 7, patternUnits: "userSpaceOnUse" },
      drawn("rect", { width: 7, height: 7, style: "fill:var(--bad-ground)" }),
      drawn("path", { d: "M0 7L7 0", style: "stroke:var(--bad-line);stroke-width:1" }));
    const clip = drawn("clipPath", { id: "view" }, drawn("rect", frame));
    svg.replaceChildren(byId("slice-title"), drawn("defs", {}, bad, clip), inside, axes);
    svg.onclick = (event) => {
      const place = svg.getBoundingClientRect();
      const share = (event.clientX - place.left) * (width / place.width);
      const rise = (event.clientY - place.top) * (height / place.height);
      const values = [...state.point];
      const put = (at, part) => {
        const { steps } = model.parameters[at];
        values[at] = valueAt(model.parameters[at], Math.min(steps, Math.max(0, Math.round(part * steps))));
      };
      put(across, (share - margin.left) / frame.width);
      if (!flat) put(up, 1 - (rise - margin.top) / frame.height);
      move(values);
    };
    const others = model.parameters.flatMap(({ words }, at) => state.axes.includes(at) ? [] : [`${words} = ${Exact.readable(state.point[at])}`]);
    const shown = model.parameters[across].words + (flat ? "" : ` (across) and ${model.parameters[up].words} (up)`);
    byId("slice-note").textContent = others.length ? `Slice at ${others.join(", ")}.` : "";
    byId("slice-text").textContent = `${shown}; the point is at ${[across, up].filter((at) => at >= 0).map((at) => Exact.readable(state.point[at])).join(", ")}. A click moves it; so do the sliders.`;
  };

  const swatch = (...content) => drawn("svg", { width: 34, height: 18, viewBox: "0 0 34 18", "aria-hidden": "true" }, ...content);
  const legendOf = (picture, ...text) => element("li", {}, picture, element("span", {}, ...text));
  const area = { x: 4, y: 3, width: 26, height: 12 };
  if (model.region) {
    byId("legend").append(
      legendOf(swatch(drawn("rect", { ...area, class: "region-valid" })), "valid: the exact envelope"),
      legendOf(swatch(drawn("rect", { ...area, fill: "url(#bad)", class: "region-bad" })), "not valid"),
    );
  } else {
    byId("legend").append(
      legendOf(swatch(drawn("rect", { ...area, class: "region-valid" })), "valid: in a box"),
      legendOf(swatch(drawn("rect", { ...area, fill: "url(#bad)", class: "region-bad" })), "not known"),
    );
  }
  const text = ({ lower, upper, lower_closed, upper_closed }) =>
    [[lower, lower_closed], [upper, upper_closed]].map(([end, closed]) => (end === null ? "∞" : `${Exact.text(end)}${closed}`)).join("|");
  const alike = (one, other) => one.intervals.every((interval, at) => text(interval) === text(other.intervals[at]));
  model.boxes.forEach((box, at) => {
    const twin = model.boxes.slice(0, at).find((other) => alike(box, other));
    const note = twin ? ` (the same as ${twin.method})` : "";
    byId("legend").append(legendOf(swatch(drawn("rect", { ...area, class: `box box-${at % 4}` })),
      `box: ${box.method}${note}`, element("span", { id: `box-${at}` })));
  });
  byId("legend").append(
    legendOf(swatch(drawn("circle", { cx: 17, cy: 9, r: 4.2, class: "nominal" })), "the plan’s values"),
    legendOf(swatch(drawn("path", { d: "M8 9H26M17 0V18", class: "point" }), drawn("circle", { cx: 17, cy: 9, r: 5.4, class: "point" })), "the values above"),
  );

  const selects = ["across", "up"].map((id, axis) => {
    const select = byId(id);
    model.parameters.forEach(({ words }, at) => select.append(element("option", { value: at }, words)));
    select.addEventListener("change", () => {
      const chosen = Number(select.value);
      if (state.axes[1 - axis] === chosen) state.axes[1 - axis] = state.axes[axis];
      state.axes[axis] = chosen;
      selects.forEach((each, at) => { each.value = state.axes[at]; });
      showSlice();
    });
    if (state.axes[axis] >= 0) select.value = state.axes[axis];
    return select;
  });
  if (model.parameters.length < 3) selects.forEach((select) => { select.disabled = model.parameters.length < 2; });
  if (model.parameters.length < 2) byId("up").parentElement.hidden = true;

  // -- the chart -----------------------------------------------------------------------------------------------------------

  const lanes = model.actions.map(({ words, varies }) => {
    const when = element("span", { class: "when" });
    const bar = element("div", { class: varies ? "bar varies" : "bar" });
    byId("gantt").append(element("div", { class: "lane", role: "listitem" },
      element("div", { class: "what" }, element("span", {}, words), when), element("div", { class: "track" }, bar)));
    return { when, bar };
  });

  const showChart = (judged) => {
    const times = judged.times;
    byId("chart-note").textContent = times === null ? "There is none at these values."
      : judged.valid === false ? "The earliest of the schedules that the network allows; it need not be the one that fails."
      : "The earliest of the schedules that the network allows.";
    const last = times === null ? Exact.ONE : times.reduce((latest, time) => (Exact.compare(time, latest) > 0 ? time : latest), Exact.ZERO);
    const length = last.n > 0n ? Exact.number(last) : 1;
    const concerned = judged.broken.flatMap(({ at }) => model.obligations[at].actions);
    lanes.forEach(({ when, bar }, at) => {
      const { id, start, end, varies } = model.actions[at];
      bar.hidden = times === null;
      bar.className = `bar${varies ? " varies" : ""}${concerned.includes(id) ? " broken" : ""}`;
      when.textContent = times === null ? "" : start === end ? `at ${Exact.readable(times[start])}` : `${Exact.readable(times[start])} to ${Exact.readable(times[end])}`;
      if (times === null) return;
      const [from, to] = [start, end].map((point) => (Exact.number(times[point]) / length) * 100);
      bar.style.left = `${Math.min(from, to)}%`;
      bar.style.width = `${Math.abs(to - from)}%`;
    });
    const marks = times === null ? [] : [...ticks(0, length, 5).filter((value) => value < 0.9 * length), length];
    byId("ticks").replaceChildren(...marks.map((value) => element("span", { style: `left:${(value / length) * 100}%` }, label(value))));
  };

  // -- all of it -------------------------------------------------------------------------------------------------------------

  let judged = null;
  let waiting = false;
  const changed = () => {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      judged = Exact.judge(model, state.point);
      showVerdict(judged);
      if (model.parameters.length) showSlice();
      showChart(judged);
    });
  };
  byId("missing").textContent = model.missing;
  if (!model.parameters.length) for (const id of ["controls", "picture"]) byId(id).hidden = true;
  new ResizeObserver(() => { if (model.parameters.length) showSlice(); }).observe(byId("picture"));
  move(nominal());
})();
