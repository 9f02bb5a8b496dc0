"use strict";
// As much of a browser as the script of the comparison's page needs, without layout: node says what the page prints.

class Element {
  constructor(name) {
    Object.assign(this, { name, children: [], attributes: {}, listeners: {}, style: {}, hidden: false, className: "", value: "" });
    this.clientWidth = 600;
    this.parentElement = { hidden: false };
  }
  setAttribute(key, value) {
    this.attributes[key] = value;
    if (key === "id") known.set(value, this);
    if (key === "class") this.className = value;
  }
  append(...content) { this.children.push(...content); }
  replaceChildren(...content) { this.children = content; }
  get textContent() { return this.children.map((one) => (one instanceof Element ? one.textContent : String(one))).join(""); }
  set textContent(text) { this.children = text === "" ? [] : [text]; }
  addEventListener(name, listener) { this.listeners[name] = listener; }
  type(text) {
    this.value = text;
    this.listeners.input();
  }
}

const known = new Map();
const byId = (id) => {
  if (!known.has(id)) known.set(id, new Element("div"));
  return known.get(id);
};
global.document = { getElementById: byId, createElement: (name) => new Element(name), createElementNS: (_, name) => new Element(name) };
global.requestAnimationFrame = (callback) => callback();
global.ResizeObserver = class { observe() {} };

/** What a page of these data says at points, which are typed into its fields. */
module.exports = (Exact, script, data, points) => {
  known.clear();
  byId("data").textContent = JSON.stringify(data);
  new Function("Exact", script)(Exact);
  const lane = (at) => byId("gantt").children[at].children;
  return {
    missing: byId("missing").textContent,
    answers: points.map((point) => {
      point.forEach((value, at) => byId(`value-${at}`).type(value));
      return {
        mark: byId("mark").textContent,
        chart: byId("chart-note").textContent,
        slice: byId("slice-note").textContent,
        reason: byId("reason").children.map((one) => [one.name, one.name === "ul" ? one.children.map((each) => each.textContent) : one.textContent]),
        legend: byId("legend").children.map((one) => one.children[1].textContent),
        times: data.actions.map((_, at) => lane(at)[0].children[1].textContent),
        broken: data.actions.filter((_, at) => lane(at)[1].children[0].className.includes("broken")).map(({ id }) => id),
      };
    }),
  };
};
