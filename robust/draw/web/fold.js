"use strict";
// Sets the pieces of a drawing on lines as wide as the window, and folds tiles. Without scripts, all is as it was drawn.
(() => {
  const svg = document.currentScript?.ownerSVGElement ?? document.documentElement;
  const inch = 72, pixels = 96, margin = 0.2, high = 0.22, pieces = PIECES;
  const made = (parent, name, attributes, text) => {
    const node = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
    node.textContent = text ?? "";
    return parent.appendChild(node);
  };
  const word = { "font-family": "DejaVu Sans, sans-serif", "font-size": 8, fill: "#0072B2" };

  function handle(node, says, act) {
    for (const [key, value] of Object.entries({ tabindex: 0, role: "button", "aria-label": says, style: "cursor:pointer" })) node.setAttribute(key, value);
    node.addEventListener("click", act);
    node.addEventListener("keydown", event => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); act(); } });
  }

  function fold(piece, folded, focus) {
    piece.closed = folded;
    piece.group.style.display = folded ? "none" : "";
    piece.box.style.display = folded ? "" : "none";
    if (focus) (folded ? piece.box : piece.mark).focus();
  }

  function prepare(piece) {
    piece.group = svg.querySelector(`[id="${piece.name}"]`);
    if (!piece.folded) return;
    const left = (piece.x + margin) * inch, top = (piece.y + margin - piece.above) * inch;
    piece.mark = made(piece.group, "g", { class: "fold" });
    made(piece.mark, "rect", { x: left, y: top, width: 16, height: 16, fill: "white", "fill-opacity": 0.01 });
    made(piece.mark, "text", { ...word, x: left + 4, y: top + 11 }, "▾");
    handle(piece.mark, `fold ${piece.folded}`, () => { fold(piece, true, true); set(); });
    piece.box = made(svg, "g", { class: "folded" });
    const label = `▸ ${piece.folded}`;
    const text = made(piece.box, "text", { ...word, x: 12, y: 3 }, label);
    piece.short = text.getComputedTextLength() / inch + 0.4;
    const frame = { x: 5, y: -10, width: piece.short * inch - 10, height: 20, rx: 4, fill: "none", stroke: "#0072B2", "stroke-dasharray": "3 2" };
    made(piece.box, "rect", { ...frame, "pointer-events": "all" });
    handle(piece.box, `unfold ${piece.folded}`, () => { fold(piece, false, true); set(); });
    fold(piece, false);
  }

  const width = piece => piece.closed ? piece.short : piece.width;
  const above = piece => piece.closed ? high : piece.above;
  const below = piece => piece.closed ? high : piece.below;

  function set() {
    const open = Math.max(...pieces.map(width)), view = svg.parentElement?.clientWidth || innerWidth;
    const room = Math.max(open, view / pixels - 2 * margin), lines = [];
    let left = 0;
    for (const piece of pieces) {
      if (!lines.length || piece.begins || left + width(piece) > room) { lines.push([]); left = 0; }
      lines.at(-1).push([piece, left]);
      left += width(piece);
    }
    let top = margin, widest = 0;
    for (const line of lines) {
      const middle = top + Math.max(...line.map(([piece]) => above(piece)));
      for (const [piece, x] of line) {
        const from = piece.made || piece.closed ? [0, 0] : [piece.x + margin, piece.y + margin];
        const to = `translate(${(x + margin - from[0]) * inch} ${(middle - from[1]) * inch})`;
        (piece.closed ? piece.box : piece.group).setAttribute("transform", to);
        widest = Math.max(widest, x + width(piece));
      }
      top = middle + Math.max(...line.map(([piece]) => below(piece)));
    }
    const size = [widest + 2 * margin, top + margin];  // a tile that is wider than the window is scrolled to, and stays readable
    svg.setAttribute("viewBox", `0 0 ${size[0] * inch} ${size[1] * inch}`);
    svg.setAttribute("width", size[0] * pixels);
    svg.setAttribute("height", size[1] * pixels);
  }

  svg.querySelector("#patch_1")?.remove();  // the ground, which is as large as what was drawn
  svg.style.background = "white";
  pieces.forEach(prepare);
  const tiles = pieces.filter(piece => piece.folded);
  if (tiles.length > 1) {
    const all = made(svg, "g", {});
    const text = made(all, "text", { ...word, x: 0, y: 3 }, "fold all");
    handle(all, "fold or unfold all", () => {
      const folded = !tiles.every(piece => piece.closed);
      tiles.forEach(piece => fold(piece, folded));
      text.textContent = folded ? "unfold all" : "fold all";
      set();
    });
    pieces.splice(1, 0, { made: true, group: all, width: 0.8, above: 0.15, below: 0.15 });
  }
  addEventListener("resize", set);
  set();
})();
