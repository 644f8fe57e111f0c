"use strict";
/* The table of a fleet: rows that pass the filters, sorted by a column; PAGE of them at first, because laying out rows takes most of the time. */
(() => {
const PAGE = 50, MISSED = 3;
const {joints, verdicts, parts, rows} = JSON.parse(document.getElementById("content").textContent);
const heads = ["recording", "answer", "verdict", "date", ...joints];
const answers = rows.map((row) => row[4].map((k) => parts[k]).join("; "));
const date = (row) => row[3] === null ? "" : new Date(1e3 * row[3]).toISOString().slice(0, 16).replace("T", " ") + (row[6] ? " *" : "");
const value = (n, k) => [rows[n][0], answers[n], verdicts[rows[n][2]], rows[n][3] ?? 0][k] ?? rows[n][5][k - 4] ?? -1;
const text = document.getElementById("text"), verdict = document.getElementById("verdict"), joint = document.getElementById("joint");
const body = document.querySelector("#recordings tbody"), more = document.querySelector(".more");
const words = rows.map((row, n) => `${row[0]} ${answers[n]}`.toLowerCase());
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
    (verdict.value === "" || rows[k][2] === Number(verdict.value)) && (joint.value === "" || rows[k][5][joint.value] > MISSED));
  body.replaceChildren();
  for (const k of found.slice(0, shown)) {
    const row = rows[k], line = add(body, "tr"), first = add(line, "td");
    if (row[1]) add(first, "a", row[0]).href = `${row[1]}/report.html`; else first.textContent = row[0];
    add(line, "td", answers[k]);
    add(line, "td", verdicts[row[2]].replaceAll("_", " "));
    add(line, "td", date(row));
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
    const keys = rows.map((_, n) => value(n, k));
    order.sort((a, b) => (keys[a] < keys[b] ? -1 : keys[a] > keys[b] ? 1 : a - b) * (up ? 1 : -1));
    for (const each of row.children) each.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", up ? "ascending" : "descending");
    draw();
  };
});
for (const filter of [text, verdict, joint]) filter.oninput = () => { shown = PAGE; draw(); };
more.onclick = () => { shown *= 2; draw(); };
draw();
})();
