"use strict";
/* The table of a fleet: rows that pass the filters, sorted by a column, in pages of PAGE rows, so that many stay fast. */
(() => {
const PAGE = 200, MISSED = 3;
const {joints, rows} = JSON.parse(document.getElementById("content").textContent);
const heads = ["recording", "answer", "verdict", "date", ...joints];
const value = (row, k) => [row[0], row[4], row[2], row[3]][k] ?? (k < 4 ? "" : row[5][k - 4] ?? -1);
const text = document.getElementById("text"), verdict = document.getElementById("verdict"), joint = document.getElementById("joint");
const body = document.querySelector("#recordings tbody"), more = document.querySelector(".more");
const words = rows.map((row) => `${row[0]} ${row[4]}`.toLowerCase());
let order = rows.map((_, k) => k), column = -1, up = true, shown = PAGE;
const opacity = (ratio) => ratio > 1 ? 0.55 * Math.min(Math.log(ratio) / Math.log(100), 1) : 0;
const add = (parent, name, content = "") => {
  const made = document.createElement(name);
  made.textContent = content;
  parent.append(made);
  return made;
};
function draw() {
  const wanted = text.value.toLowerCase().split(/\s+/);
  const found = order.filter((k) => wanted.every((word) => words[k].includes(word)) &&
    (!verdict.value || rows[k][2] === verdict.value) && (joint.value === "" || rows[k][5][joint.value] > MISSED));
  body.replaceChildren();
  for (const k of found.slice(0, shown)) {
    const row = rows[k], line = add(body, "tr"), first = add(line, "td");
    if (row[1]) add(first, "a", row[0]).href = row[1]; else first.textContent = row[0];
    add(line, "td", row[4]);
    add(line, "td", row[2].replaceAll("_", " "));
    add(line, "td", row[3].slice(0, 16));
    for (const ratio of row[5]) {
      const cell = add(line, "td", ratio === null ? "-" : ratio >= 10 ? ratio.toFixed(0) : ratio.toPrecision(2));
      if (ratio > 1) cell.style.background = `rgba(var(--heat),${opacity(ratio).toFixed(2)})`;
    }
  }
  more.hidden = found.length <= shown;
  document.getElementById("count").textContent = `${found.length} of ${rows.length} recordings`;
}
const row = document.querySelector("#recordings thead tr");
heads.forEach((name, k) => {
  const head = add(row, "th"), button = add(head, "button", name);
  head.scope = "col";
  button.onclick = () => {
    up = column === k ? !up : k < 4;
    column = k;
    const keys = rows.map((each) => value(each, k));
    order.sort((a, b) => (keys[a] < keys[b] ? -1 : keys[a] > keys[b] ? 1 : a - b) * (up ? 1 : -1));
    for (const each of row.children) each.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", up ? "ascending" : "descending");
    draw();
  };
});
for (const filter of [text, verdict, joint]) filter.oninput = () => { shown = PAGE; draw(); };
more.onclick = () => { shown += PAGE; draw(); };
draw();
})();
