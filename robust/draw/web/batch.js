"use strict";
// Headings are buttons that sort the table: by numbers where cells have them, else by their texts.

const body = document.querySelector("table.sorted tbody"), heads = [...document.querySelectorAll("table.sorted th")];
const key = cell => "order" in cell.dataset ? Number(cell.dataset.order) : cell.textContent;
const compared = (a, b) => typeof a === "number" && typeof b === "number" ? a - b
  : String(a).localeCompare(String(b), "en", {numeric: true});

heads.forEach((head, place) => head.querySelector("button").addEventListener("click", () => {
  const down = head.getAttribute("aria-sort") === "ascending";
  heads.forEach(one => one.removeAttribute("aria-sort"));
  head.setAttribute("aria-sort", down ? "descending" : "ascending");
  const rows = [...body.rows].sort((a, b) => compared(key(a.cells[place]), key(b.cells[place])));
  body.append(...(down ? rows.reverse() : rows));
}));
