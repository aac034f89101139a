"use strict";
// Opens every page of PAGES in frames of two widths and writes what is wrong into #result, a line each.
const result = document.getElementById("result");
const wait = ms => new Promise(done => setTimeout(done, ms));
async function open(html, width) {
  const frame = document.createElement("iframe");
  frame.style = `width: ${width}px; height: 900px; border: 0`;
  const loaded = new Promise(done => { frame.onload = done; });
  frame.srcdoc = html;
  document.body.append(frame);
  await loaded;
  await wait(50);
  return frame;
}
function* faults(frame, width) {
  const win = frame.contentWindow, doc = frame.contentDocument, all = q => [...doc.querySelectorAll(q)];
  const root = doc.documentElement, shown = e => e.getClientRects().length > 0;
  if (root.scrollWidth > root.clientWidth) {
    const wide = all("main *").filter(e => e.getBoundingClientRect().right > root.clientWidth + 1 && !e.closest(".wide"));
    yield `${root.scrollWidth} px wide: ${wide.slice(0, 3).map(e => e.outerHTML.slice(0, 80)).join(" | ")}`;
  }
  const light = win.getComputedStyle(doc.body).backgroundColor.match(/\d+/g).slice(0, 3).map(Number);
  if (DARK !== Math.max(...light) < 100) yield `the ground is ${light}`;
  for (const r of win.performance.getEntriesByType("resource")) {
    if (!r.name.startsWith("data:")) yield `loads ${r.name}`;
  }
  for (const e of all("[role=img]")) if (!e.getAttribute("aria-label")) yield `no name: ${e.outerHTML.slice(0, 80)}`;
  for (const e of all("img")) if (!e.alt) yield `no alt: ${e.outerHTML.slice(0, 80)}`;
  const ids = all("[id]").map(e => e.id);
  for (const id of ids) if (ids.indexOf(id) !== ids.lastIndexOf(id)) yield `twice the id ${id}`;
  for (const e of all("h2")) if (!e.id || !e.querySelector("a.anchor")) yield `no link: ${e.textContent}`;
  for (const a of all('a[href^="#"]')) {
    if (!doc.getElementById(decodeURIComponent(a.getAttribute("href").slice(1)))) yield `leads nowhere: ${a.getAttribute("href")}`;
  }
  for (const e of all(".chart")) {
    const svgs = [...e.querySelectorAll("svg")].filter(shown), across = svgs.map(s => s.getBoundingClientRect());
    if (e.closest("details:not([open])")) continue;
    if (svgs.length !== 1) yield `${svgs.length} drawings of ${e.getAttribute("aria-label")}`;
    else if (across[0].right > width || across[0].width < 200) yield `cut: ${e.getAttribute("aria-label")}`;
  }
  for (const words of ["made by", "command", "seed"]) {
    if (![...all("footer dt")].some(e => e.textContent === words)) yield `the foot does not say: ${words}`;
  }
  if (/\bNaN\b|undefined|`/.test(doc.querySelector("main") ? doc.querySelector("main").innerText : "")) yield "NaN, undefined or a backtick";
  const head = all("thead th.n.sorts").filter(shown)[0];
  if (head) {
    head.click();
    const column = [...head.closest("table").tBodies[0].rows].map(r => parseFloat(r.cells[head.cellIndex].textContent.replace("−", "-")));
    const known = column.filter(v => !isNaN(v));
    if (known.some((v, i) => i && v < known[i - 1])) yield `not sorted: ${column}`;
  }
  const tip = all(".tip").filter(shown)[0];
  if (tip) {
    tip.dispatchEvent(new win.PointerEvent("pointerover", { bubbles: true }));
    const hint = doc.querySelector(".hint");
    if (!hint || hint.hidden || !hint.textContent) yield "a point does not tell what it is";
  }
  const zoom = all("button.zoom").filter(shown)[0];
  if (zoom) {
    zoom.click();
    const dialog = doc.querySelector("dialog");
    if (!dialog.open || !dialog.querySelector("img")) yield "a picture does not enlarge";
    dialog.click();
    if (dialog.open) yield "a picture does not close";
  }
  const canvas = doc.getElementById("view");
  if (canvas && !doc.querySelector("#over text") && doc.getElementById("no-webgl").hidden) yield "no scale bar";
}
(async () => {
  const lines = [];
  for (const [name, html] of PAGES) for (const width of [1280, 400]) {
    const frame = await open(html, width);
    for (const fault of faults(frame, width)) lines.push(`${name} at ${width} px: ${fault}`);
    lines.push(`looked at ${name} at ${width} px`);
    frame.remove();
  }
  result.textContent = lines.join("\n");
})();
