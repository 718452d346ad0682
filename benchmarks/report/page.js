"use strict";
// Pointing at a method in a legend, or moving to it by the keyboard, leaves its curve alone.
for (const entry of document.querySelectorAll(".legend li")) {
  const figure = entry.closest("figure");
  const point = (on) => {
    figure.classList.toggle("pointed", on);
    for (const series of figure.querySelectorAll(".series")) {
      series.classList.toggle("on", on && series.dataset.series === entry.dataset.series);
    }
  };
  for (const event of ["pointerenter", "focus"]) entry.addEventListener(event, () => point(true));
  for (const event of ["pointerleave", "blur"]) entry.addEventListener(event, () => point(false));
}
// A click on a title sorts the table by that column; another one turns the order round.
const value = (row, column) => row.cells[column].textContent;
const compare = (a, b) => {
  const [x, y] = [Number(a), Number(b)];
  if (Number.isFinite(x) && Number.isFinite(y)) return x - y;
  if (Number.isFinite(x) !== Number.isFinite(y)) return Number.isFinite(x) ? -1 : 1;
  return a.localeCompare(b);
};
for (const title of document.querySelectorAll("table.sortable th")) {
  title.addEventListener("click", () => {
    const body = title.closest("table").tBodies[0];
    const down = title.dataset.order === "up";
    for (const other of title.parentNode.cells) delete other.dataset.order;
    title.dataset.order = down ? "down" : "up";
    const rows = [...body.rows];
    rows.sort((a, b) => (down ? -1 : 1) * compare(value(a, title.cellIndex), value(b, title.cellIndex)));
    body.append(...rows);
  });
}
