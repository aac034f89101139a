"use strict";
// Points and path by WebGL: the map is framed whole, with axes, a scale bar and sigma in colour.
(() => {
const data = JSON.parse(document.getElementById("map-data").textContent);
const { low, high, sigma, path } = data, text = atob(data.points);
const bytes = Uint8Array.from(text, c => c.charCodeAt(0));
const n = bytes.length / 10, place = new Float32Array(3 * n), colour = new Uint8Array(4 * n);
for (let i = 0; i < n; i++) {
  for (let k = 0; k < 3; k++) {
    const word = bytes[10 * i + 2 * k] | bytes[10 * i + 2 * k + 1] << 8;
    place[3 * i + k] = low[k] + (high[k] - low[k]) * word / 65535;
  }
  for (let k = 0; k < 4; k++) colour[4 * i + k] = bytes[10 * i + 6 + k];
}
const by = id => document.getElementById(id);
const canvas = by("view"), over = by("over");
const gl = canvas.getContext("webgl", { antialias: true, preserveDrawingBuffer: true });
if (!gl) { by("no-webgl").hidden = false; return; }
const vertex = `attribute vec3 place; attribute vec4 colour; uniform mat4 m; uniform float size, mode; varying vec3 shown;
vec3 ramp(float t) { vec3 a = mix(vec3(.27,0.,.33), vec3(.16,.47,.57), clamp(t*2.,0.,1.)); return mix(a, vec3(.99,.91,.15), clamp(t*2.-1.,0.,1.)); }
void main() { gl_Position = m * vec4(place, 1.); gl_PointSize = clamp(size / gl_Position.w, 1., 12.); shown = mode > 1.5 ? vec3(1.,.35,.2) : mode > .5 ? ramp(colour.a) : colour.rgb; }`;
const fragment = "precision mediump float; varying vec3 shown; void main() { gl_FragColor = vec4(shown, 1.); }";
const program = gl.createProgram();
for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
  const shader = gl.createShader(kind); gl.shaderSource(shader, source); gl.compileShader(shader);
  if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
  gl.attachShader(program, shader);
}
gl.linkProgram(program); gl.useProgram(program);
const buffer = data => { const b = gl.createBuffer(); gl.bindBuffer(gl.ARRAY_BUFFER, b); gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW); return b; };
const places = buffer(place), colours = buffer(colour), line = buffer(new Float32Array(path));
const at = name => gl.getAttribLocation(program, name), uniform = name => gl.getUniformLocation(program, name);
gl.enable(gl.DEPTH_TEST); gl.clearColor(0.086, 0.094, 0.11, 1);

const F = 1.4; // focal length, half heights of the window
let mode = 0, withPath = true, yaw, pitch, away, centre;
// Optical frame: x right, y down, z forward. The eye looks along z with y down.
const turn = () => {
  const cy = Math.cos(yaw), sy = Math.sin(yaw), cp = Math.cos(pitch), sp = Math.sin(pitch);
  return [[cy, 0, -sy], [sp * sy, cp, sp * cy], [cp * sy, -sp, cp * cy]];
};
const seen = p => turn().map(row => row.reduce((sum, v, k) => sum + v * (p[k] - centre[k]), 0));
// From 98 % of the points along each axis and the whole path: as near as all of them are in the window.
function home() {
  yaw = 0.25; pitch = -0.35;
  const step = Math.max(1, n >> 12), some = [];
  for (let i = 0; i < n; i += step) some.push([0, 1, 2].map(k => place[3 * i + k]));
  const ends = [0, 1, 2].map(k => {
    const sorted = some.map(p => p[k]).sort((a, b) => a - b), last = sorted.length - 1;
    return last < 0 ? [0, 1] : [sorted[Math.floor(0.01 * last)], sorted[Math.ceil(0.99 * last)]];
  });
  const inside = some.filter(p => p.every((v, k) => v >= ends[k][0] && v <= ends[k][1]));
  for (let i = 0; i < path.length; i += 3) inside.push([path[i], path[i + 1], path[i + 2]]);
  centre = [0, 1, 2].map(k => {
    const all = inside.map(p => p[k]);
    return all.length ? (Math.min(...all) + Math.max(...all)) / 2 : 0;
  });
  const aspect = canvas.clientWidth / canvas.clientHeight || 1;
  // What is near looks larger: the middle of the window is not that of the room, so look again.
  for (let round = 0; round < 6; round++) {
    away = 0.3;
    const places = inside.map(seen);
    for (const [x, y, z] of places) {
      away = Math.max(away, 1.06 * F * Math.max(Math.abs(x) / aspect, Math.abs(y)) - z, 0.1 - z);
    }
    const [right, down] = turn();
    const off = [0, 1].map(k => {
      const ends = places.map(p => p[k] / (p[2] + away));
      return ends.length ? away * (Math.min(...ends) + Math.max(...ends)) / 2 : 0;
    });
    for (let k = 0; k < 3; k++) centre[k] += off[0] * right[k] + off[1] * down[k];
  }
}
function matrix() {
  const r = turn(), aspect = canvas.width / canvas.height, near = 0.02, far = 200;
  const t = r.map(row => -row.reduce((sum, v, k) => sum + v * centre[k], 0));
  t[2] += away;
  const a = (far + near) / (far - near), b = -2 * far * near / (far - near), m = new Float32Array(16);
  for (let c = 0; c < 4; c++) {
    const col = i => c < 3 ? r[i][c] : t[i];
    m[4 * c] = F / aspect * col(0); m[4 * c + 1] = -F * col(1); m[4 * c + 2] = a * col(2) + (c === 3 ? b : 0); m[4 * c + 3] = col(2);
  }
  return m;
}
// The scale bar holds at the distance of the middle; axes are those of the first camera.
function overlay() {
  const w = canvas.clientWidth, h = canvas.clientHeight, pixels = F * h / 2 / away, room = Math.min(220, w / 3) / pixels;
  const decade = 10 ** Math.floor(Math.log10(room)), metres = [5, 2, 1].find(f => f * decade <= room) * decade;
  const shown = metres < 0.01 ? `${+(1000 * metres).toPrecision(1)} mm` : metres < 1 ? `${+(100 * metres).toPrecision(1)} cm` : `${metres} m`;
  const end = 16 + metres * pixels, y = h - 16, r = turn(), o = [w - 52, h - 52];
  let svg = `<line x1="16" y1="${y}" x2="${end}" y2="${y}"/><line x1="16" y1="${y - 5}" x2="16" y2="${y + 5}"/><line x1="${end}" y1="${y - 5}" x2="${end}" y2="${y + 5}"/><text x="16" y="${y - 10}">${shown}</text>`;
  ["x", "y", "z"].forEach((name, k) => {
    const to = [o[0] + 32 * r[0][k], o[1] + 32 * r[1][k]], colour = ["#ff6b5e", "#7ddc6f", "#6fb1ff"][k];
    svg += `<line x1="${o[0]}" y1="${o[1]}" x2="${to[0]}" y2="${to[1]}" style="stroke:${colour}"/><text x="${o[0] + 44 * r[0][k] - 4}" y="${o[1] + 44 * r[1][k] + 4}" style="fill:${colour}">${name}</text>`;
  });
  over.innerHTML = svg;
}
function draw() {
  canvas.width = canvas.clientWidth * devicePixelRatio; canvas.height = canvas.clientHeight * devicePixelRatio;
  gl.viewport(0, 0, canvas.width, canvas.height); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  gl.uniformMatrix4fv(uniform("m"), false, matrix());
  gl.uniform1f(uniform("size"), 0.012 * canvas.height);
  gl.uniform1f(uniform("mode"), mode);
  gl.enableVertexAttribArray(at("place")); gl.bindBuffer(gl.ARRAY_BUFFER, places); gl.vertexAttribPointer(at("place"), 3, gl.FLOAT, false, 0, 0);
  gl.enableVertexAttribArray(at("colour")); gl.bindBuffer(gl.ARRAY_BUFFER, colours); gl.vertexAttribPointer(at("colour"), 4, gl.UNSIGNED_BYTE, true, 0, 0);
  gl.drawArrays(gl.POINTS, 0, n);
  if (withPath) {
    gl.uniform1f(uniform("mode"), 2); gl.disableVertexAttribArray(at("colour")); gl.vertexAttrib4f(at("colour"), 1, 1, 1, 1);
    gl.bindBuffer(gl.ARRAY_BUFFER, line); gl.vertexAttribPointer(at("place"), 3, gl.FLOAT, false, 0, 0);
    gl.drawArrays(gl.LINE_STRIP, 0, path.length / 3);
  }
  overlay();
}
// Ticks at 1, 2 and 5 times powers of ten, between the ends that the data have.
(() => {
  const at = v => 100 * Math.log(v / sigma[0]) / Math.log(sigma[1] / sigma[0]);
  let last = -20;
  for (let e = -6; e < 1; e++) for (const f of [1, 2, 5]) {
    const v = f * 10 ** e, place = at(v);
    if (place < 0 || place > 100 || place - last < 16) continue;
    last = place;
    const tick = document.createElement("span");
    tick.style.left = place + "%";
    tick.textContent = `${+(1000 * v).toPrecision(1)} mm`;
    by("sigmas").append(tick);
  }
})();
let held = null;
canvas.onpointerdown = e => { held = [e.clientX, e.clientY, e.shiftKey || e.button === 2]; canvas.setPointerCapture(e.pointerId); };
canvas.onpointerup = () => { held = null; };
canvas.oncontextmenu = e => e.preventDefault();
canvas.onpointermove = e => {
  if (!held) return;
  const dx = e.clientX - held[0], dy = e.clientY - held[1]; held[0] = e.clientX; held[1] = e.clientY;
  if (held[2]) {
    const s = 2 * away / F / canvas.clientHeight, [right, down] = turn();
    for (let k = 0; k < 3; k++) centre[k] -= s * (dx * right[k] + dy * down[k]);
  } else { yaw += dx * 0.006; pitch = Math.max(-1.57, Math.min(1.57, pitch - dy * 0.006)); }
  draw();
};
canvas.addEventListener("wheel", e => { e.preventDefault(); away = Math.max(0.05, away * Math.exp(e.deltaY * 0.001)); draw(); }, { passive: false });
by("mode").onclick = () => {
  mode = 1 - mode; by("mode").textContent = mode ? "show colour" : "show σ"; by("sigmas").hidden = !mode; draw();
};
by("path").onclick = () => { withPath = !withPath; by("path").textContent = withPath ? "hide path" : "show path"; draw(); };
by("home").onclick = () => { home(); draw(); };
addEventListener("resize", draw);
home();
if (location.hash === "#sigma") by("mode").onclick(); else draw();
})();
