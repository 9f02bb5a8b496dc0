"use strict";
// One JSON object for each change of a run; between two of them a clock goes on by itself where there is one.

const at = id => document.getElementById(id);
const made = (name, kind, text) => { const node = document.createElement(name); node.className = kind; node.textContent = text; return node; };
const put = (id, nodes) => at(id).replaceChildren(...nodes);
const short = number => String(Number(number.toFixed(Math.abs(number) < 100 ? 1 : 0)));
const percent = (share, round) => `${round(share * 1000) / 10} %`;
const says = {
  "on track": ["On track", "It succeeds if steps take as long as planned; room says how much later they may end, one at a time."],
  "at risk": ["At risk", "It succeeds only if some steps take less time than planned."],
  broken: ["Broken", "No continuation that the plan allows succeeds."],
  done: ["Done", "All has happened as the plan allows."],
  failed: ["Failed", "No correct execution is left."],
  running: ["Running", "A correct execution is still possible; room says what bounds in time allow."],
};
let shown = null, came = 0;

const now = () => shown.rate === null || shown.status === "done" || shown.status === "failed" ? shown.now
  : shown.now + (performance.now() - came) / 1000 / shown.rate;

function room(lane, time) {
  const [, latestStart, latestEnd] = lane.window ?? [];
  if (lane.state === "done") return `${short(lane.bar[0])} – ${short(lane.bar[1])}`;
  if (lane.state === "running") return latestEnd === null ? "may take any time" : latestEnd > time ? `may still take ${short(latestEnd - time)}` : "too late";
  if (latestStart !== null && latestStart < time) return "too late";
  const from = lane.bar[0] > time ? `from ${short(lane.bar[0])}` : "now";
  return latestStart === null ? `${from}, no limit` : `${from}, until ${short(latestStart)}`;
}

function roundNumbers(from, to) {  // six at most
  const power = 10 ** Math.floor(Math.log10((to - from) / 5)), step = power * [1, 2, 5, 10].find(each => each * power >= (to - from) / 5);
  const first = Math.ceil(from / step);
  return Array.from({length: Math.floor(to / step) - first + 1}, (_, count) => (first + count) * step);
}

function draw() {
  const time = now(), lanes = shown.lanes;
  at("now").textContent = short(time);
  at("ending").hidden = shown.kind === "bad";
  put("ends", shown.ends.length ? shown.ends.map(([name, step, end]) => made("li", end - time < 0 ? "bad" : "",
    `${name}${step ? ` (${step})` : ""} must end by ${short(end)}${end >= time ? `: ${short(end - time)} left` : ""}`)) : [made("li", "", "nothing that runs now")]);
  const known = lanes.flatMap(lane => [...lane.bar, ...(lane.window ?? [])]).filter(value => value !== null);
  const first = Math.min(time, ...known), last = Math.max(time, first + 1, ...known), span = (last - first) * 1.02;
  const place = value => 100 * (value - first) / span;
  const strip = (kind, from, to) => {
    const node = made("span", kind, "");
    node.style.left = `${place(from)}%`; node.style.width = `${Math.max(0, place(Math.min(to, last)) - place(from))}%`;
    return node;
  };
  put("lanes", lanes.map(lane => {
    const row = made("div", `lane ${lane.state}`, ""), what = made("div", "what", ""), track = made("div", "track", "");
    const left = lane.state === "running" && lane.window[2] !== null ? lane.window[2] - Math.max(time, lane.bar[1]) : null;
    const when = room(lane, time);
    what.append(made("span", "", lane.name), made("span", (left !== null && left < 0) || when === "too late" ? "when bad" : "when", when));
    const [begin, end] = lane.bar;
    if (lane.window) track.append(strip("room", begin, lane.window[2] ?? last));
    if (lane.state === "running") track.append(strip("bar plans", begin, end), strip("bar runs", begin, Math.max(time, begin)));
    else track.append(strip(lane.state === "done" ? "bar" : "bar plans", begin, end));
    track.append(strip("moment", time, time));
    row.append(what, track);
    return row;
  }));
  put("ticks", roundNumbers(first, first + span).map(value => {
    const tick = made("span", "", short(value)); tick.style.left = `${place(value)}%`; return tick;
  }));
}

function show(text) {
  shown = JSON.parse(text); came = performance.now();
  const [mark, promise] = says[shown.status] ?? [shown.status, ""];
  at("mark").textContent = mark; at("promise").textContent = promise;
  at("verdict").className = {good: "valid", bad: "invalid"}[shown.kind] ?? "";
  put("reasons", shown.reasons.map(reason => made("li", "", reason)));
  at("saying").hidden = !shown.said.length;
  put("said", shown.said.map(([when, what, kind]) => made("li", kind, `${when}  ${what}`)));
  at("before").textContent = shown.before ? `${shown.before} steps before these` : "";
  at("after").textContent = shown.after ? `${shown.after} more steps to come` : "";
  at("choosing").hidden = !shown.choices?.length;
  put("choices", (shown.choices ?? []).map(choice => {
    const row = made("li", "", `${choice.name}${choice.ours ? "" : " (people)"}: `);
    choice.values.forEach(value => row.append(made("span", choice.chosen !== null ? value === choice.chosen ? "value chosen" : "value gone"
      : choice.possible && !choice.possible.includes(value) ? "value gone" : "value", value)));
    if (choice.chosen === null && !choice.possible) row.append(made("span", "note", "open"));
    return row;
  }));
  const {success, promised} = shown;
  const ends = success ? [percent(success[0], Math.floor), percent(success[1], Math.ceil)] : [];
  at("chance").textContent = success ? `succeeds with probability ${[...new Set(ends)].join(" to ")}` : "";
  at("promising").hidden = !promised?.length;
  put("promised", (promised ?? []).map(([step, name, low, high]) =>
    made("li", "", `${name} (${step}): ${short(low)} to ${high === null ? "any time" : short(high)}`)));
  draw();
}

const source = new EventSource("events");
source.onmessage = event => { at("link").textContent = "live"; show(event.data); };
source.onerror = () => { at("link").textContent = "no connection: the run has ended, or cannot be reached"; shown && (shown.rate = null); };
setInterval(() => shown && shown.rate !== null && draw(), 500);
