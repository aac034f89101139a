"use strict";
// Tables sort by the column whose title is clicked; a second click turns the order round.
const power = /(-?[\d.]+)·10(-?\d+)|10(-\d+)|(-?[\d.]+)/;
function key(cell, numeric) {
  const text = cell ? cell.textContent.trim().replaceAll("−", "-").replaceAll(",", "") : "";
  if (!numeric) return text;
  const m = power.exec(text);
  if (!m) return Number.MAX_VALUE;
  return m[1] ? +m[1] * 10 ** +m[2] : m[3] ? 10 ** +m[3] : +m[4];
}
for (const head of document.querySelectorAll("thead th")) {
  const body = head.closest("table").tBodies[0];
  if (!body || body.rows.length < 2 || !head.textContent) continue;
  const column = head.cellIndex, numeric = head.classList.contains("n");
  const sort = () => {
    const down = head.getAttribute("aria-sort") === "ascending";
    for (const other of head.parentNode.cells) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", down ? "descending" : "ascending");
    const rows = [...body.rows].map(row => [key(row.cells[column], numeric), row]);
    rows.sort(([a], [b]) => numeric ? (a === b ? 0 : a - b) : a.localeCompare(b, "en", { numeric: true }));
    if (down) rows.reverse();
    body.append(...rows.map(([, row]) => row));
  };
  head.tabIndex = 0;
  head.classList.add("sorts");
  head.onclick = sort;
  head.onkeydown = e => { if (e.key === "Enter" || e.key === " ") { e.preventDefault(); sort(); } };
}
// What a point is, at once and on a touch; a browser's own hint comes late, and to a mouse alone.
const hint = document.createElement("div");
hint.className = "hint";
hint.hidden = true;
document.body.append(hint);
addEventListener("pointerover", e => {
  const point = e.target.closest && e.target.closest(".tip");
  hint.hidden = !point;
  if (!point) return;
  const title = point.querySelector("title");
  if (title) { point.dataset.tip = title.textContent; title.remove(); }
  hint.textContent = point.dataset.tip;
  const at = point.getBoundingClientRect(), own = hint.getBoundingClientRect();
  hint.style.left = Math.max(4, Math.min(at.left, innerWidth - own.width - 4)) + "px";
  hint.style.top = (at.top > own.height + 8 ? at.top - own.height - 6 : at.bottom + 6) + "px";
});
// A picture fills the window until the next click or Escape.
const large = document.createElement("dialog");
large.onclick = () => large.close();
document.body.append(large);
for (const button of document.querySelectorAll("button.zoom")) {
  button.onclick = () => {
    const image = button.querySelector("img").cloneNode(), words = document.createElement("p");
    words.textContent = image.alt;
    large.replaceChildren(image, words);
    large.showModal();
  };
}
for (const button of document.querySelectorAll("button.copy")) {
  button.onclick = async () => {
    const text = document.getElementById(button.dataset.of);
    getSelection().selectAllChildren(text);
    // Where a page may not write to the clipboard the text is selected, for Ctrl-C.
    try { await navigator.clipboard.writeText(text.textContent); button.textContent = "copied"; }
    catch { button.textContent = "selected"; }
  };
}
// A link to what is folded opens it.
const unfold = () => {
  const aim = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
  for (let fold = aim; fold; fold = fold.parentElement) if (fold.tagName === "DETAILS") fold.open = true;
};
addEventListener("hashchange", unfold);
unfold();
