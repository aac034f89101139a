"use strict";
// Surfels and path by WebGL: the map is framed whole, with axes, a scale bar, sigma in colour, and the camera at a time.
(() => {
const data = JSON.parse(document.getElementById("map-data").textContent);
const { low, high, sigma, spacing, seconds, path, turns, truth } = data, text = atob(data.points);
const bytes = Uint8Array.from(text, c => c.charCodeAt(0));
const n = bytes.length / 13, place = new Float32Array(3 * n), colour = new Uint8Array(4 * n), bent = new Uint8Array(4 * n);
for (let i = 0; i < n; i++) {
  for (let k = 0; k < 3; k++) {
    const word = bytes[13 * i + 2 * k] | bytes[13 * i + 2 * k + 1] << 8;
    place[3 * i + k] = low[k] + (high[k] - low[k]) * word / 65535;
  }
  for (let k = 0; k < 4; k++) colour[4 * i + k] = bytes[13 * i + 8 + k];
  [bent[4 * i], bent[4 * i + 1], bent[4 * i + 2]] = [bytes[13 * i + 6], bytes[13 * i + 7], bytes[13 * i + 12]];
}
const by = id => document.getElementById(id);
const canvas = by("view"), over = by("over"), when = by("when");
const gl = canvas.getContext("webgl", { antialias: true, preserveDrawingBuffer: true });
if (!gl) { by("no-webgl").hidden = false; return; }
// A disc along the surface is an ellipse on the screen; its shade is that of a lamp beside the eye. Modes: 0 colour,
// 1 sigma, 2 a line in one colour.
const vertex = `attribute vec3 place, bent; attribute vec4 colour; uniform mat4 m; uniform mat3 turn;
uniform mediump float mode; uniform float size; uniform vec2 apart; uniform vec3 line; varying vec3 shown, facing;
vec3 ramp(float t) { vec3 a = mix(vec3(.27,0.,.33), vec3(.16,.47,.57), clamp(t*2.,0.,1.)); return mix(a, vec3(.99,.91,.15), clamp(t*2.-1.,0.,1.)); }
vec3 normal() {
  vec2 e = bent.xy * 2. - 1.; vec3 d = vec3(e, 1. - abs(e.x) - abs(e.y));
  if (d.z < 0.) d.xy = (1. - abs(d.yx)) * vec2(d.x < 0. ? -1. : 1., d.y < 0. ? -1. : 1.);
  return normalize(d);
}
void main() {
  gl_Position = m * vec4(place, 1.); gl_PointSize = clamp(size * apart.x * pow(apart.y / apart.x, bent.z) / gl_Position.w, 1.5, 96.);
  facing = turn * normal(); if (facing.z > 0.) facing = -facing;
  shown = mode > 1.5 ? line : mode > .5 ? ramp(colour.a) : colour.rgb;
}`;
const fragment = `precision mediump float; uniform mediump float mode; varying vec3 shown, facing;
void main() {
  if (mode > 1.5) { gl_FragColor = vec4(shown, 1.); return; }
  vec2 c = gl_PointCoord * 2. - 1.; float deep = dot(facing.xy, c) / max(-facing.z, .2);
  if (dot(c, c) + deep * deep > 1.) discard;
  gl_FragColor = vec4(shown * (.45 + .55 * max(dot(normalize(facing), vec3(.27, -.45, -.85)), 0.)), 1.);
}`;
const program = gl.createProgram();
for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
  const shader = gl.createShader(kind); gl.shaderSource(shader, source); gl.compileShader(shader);
  if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
  gl.attachShader(program, shader);
}
gl.linkProgram(program); gl.useProgram(program);
const buffer = (data, use = gl.STATIC_DRAW) => { const b = gl.createBuffer(); gl.bindBuffer(gl.ARRAY_BUFFER, b); gl.bufferData(gl.ARRAY_BUFFER, data, use); return b; };
const places = buffer(place), normals = buffer(bent), colours = buffer(colour);
const line = buffer(new Float32Array(path)), trueLine = buffer(new Float32Array(truth)), pyramid = buffer(new Float32Array(48), gl.DYNAMIC_DRAW);
const at = name => gl.getAttribLocation(program, name), uniform = name => gl.getUniformLocation(program, name);
gl.enable(gl.DEPTH_TEST); gl.clearColor(0.086, 0.094, 0.11, 1);
const ORANGE = [1, .35, .2], DIM = [.55, .25, .18], WHITE = [.92, .92, .92], YELLOW = [1, .85, .3];
const frames = path.length / 3;
when.max = Math.max(frames - 1, 0); when.value = when.max;

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
  const lines = [["estimate", "#ff5933"], ["truth", "#ebebeb"]].slice(0, truth.length ? 2 : 1);
  if (withPath && frames) lines.forEach(([name, colour], i) => {
    svg += `<line x1="16" y1="${20 + 18 * i}" x2="36" y2="${20 + 18 * i}" style="stroke:${colour}"/><text x="42" y="${24 + 18 * i}">${name}</text>`;
  });
  over.innerHTML = svg;
}
// Lines from the camera to the corners of its picture, as a tenth of the map's width, and around them.
function camera(k) {
  const [x, y, z, w] = turns.slice(4 * k, 4 * k + 4), size = 0.06 * Math.hypot(...[0, 1, 2].map(i => high[i] - low[i]));
  const turned = v => {
    const t = [2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])];
    return [v[0] + w * t[0] + y * t[2] - z * t[1], v[1] + w * t[1] + z * t[0] - x * t[2], v[2] + w * t[2] + x * t[1] - y * t[0]];
  };
  const eye = path.slice(3 * k, 3 * k + 3);
  const corner = [[-.6, -.45, 1], [.6, -.45, 1], [.6, .45, 1], [-.6, .45, 1]].map(v => turned(v).map((c, i) => eye[i] + size * c));
  return new Float32Array(corner.flatMap((c, i) => [...eye, ...c, ...c, ...corner[(i + 1) % 4]]));
}
function strip(buffer, colour, kind, count) {
  gl.uniform3fv(uniform("line"), colour); gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
  gl.vertexAttribPointer(at("place"), 3, gl.FLOAT, false, 0, 0); gl.drawArrays(kind, 0, count);
}
// The first points are spread over the whole map: what moves shows as many as are smooth, what stands still all.
let share = 1, moved = 0, last = 0, painted = 0;
function paint(points) {
  const [width, height] = [canvas.clientWidth, canvas.clientHeight].map(side => Math.round(side * devicePixelRatio));
  // To set a size, even the same, makes the buffers anew.
  if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
  gl.viewport(0, 0, canvas.width, canvas.height); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  gl.uniformMatrix4fv(uniform("m"), false, matrix());
  const r = turn();
  gl.uniformMatrix3fv(uniform("turn"), false, [0, 1, 2].flatMap(c => r.map(row => row[c])));
  // A disc's diameter reaches over the gaps to its neighbours' discs, the wider the fewer are drawn.
  gl.uniform1f(uniform("size"), 1.8 * Math.sqrt(n / Math.max(points, 1)) * F * canvas.height / 2);
  gl.uniform2fv(uniform("apart"), spacing);
  gl.uniform1f(uniform("mode"), mode);
  for (const [name, buffer, size, type] of [["place", places, 3, gl.FLOAT], ["bent", normals, 3, gl.UNSIGNED_BYTE], ["colour", colours, 4, gl.UNSIGNED_BYTE]]) {
    gl.enableVertexAttribArray(at(name)); gl.bindBuffer(gl.ARRAY_BUFFER, buffer); gl.vertexAttribPointer(at(name), size, type, type !== gl.FLOAT, type === gl.FLOAT ? 0 : 4, 0);
  }
  gl.drawArrays(gl.POINTS, 0, points);
  gl.disableVertexAttribArray(at("bent")); gl.disableVertexAttribArray(at("colour")); gl.uniform1f(uniform("mode"), 2);
  if (withPath && frames) {
    const k = +when.value;
    if (truth.length) strip(trueLine, WHITE, gl.LINE_STRIP, truth.length / 3);
    strip(line, ORANGE, gl.LINE_STRIP, k + 1); strip(line, DIM, gl.LINE_STRIP, frames);
    gl.bindBuffer(gl.ARRAY_BUFFER, pyramid); gl.bufferSubData(gl.ARRAY_BUFFER, 0, camera(k));
    strip(pyramid, YELLOW, gl.LINES, 16);
  }
  overlay();
}
// From one frame of a movement to the next is what a frame takes, however long: a slow machine needs it the most.
const again = () => {
  const goesOn = performance.now() - painted < 150;
  requestAnimationFrame(now => {
    const took = now - last, moving = now - moved < (goesOn ? Math.max(150, 2 * took) : 150);
    if (moving && goesOn) share = Math.min(1, Math.max(share * (took > 40 ? Math.max(0.2, 30 / took) : took < 22 ? 1.2 : 1), 20000 / n));
    last = now;
    paint(moving ? Math.ceil(Math.min(1, share) * n) : n);
    painted = performance.now(); waiting = false;
    if (moving) draw();
  });
};
let waiting = false;
function draw() { if (!waiting) { waiting = true; again(); } }
function move() { moved = performance.now(); draw(); }
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
// One finger or button turns, two fingers, shift or the right button move; fingers apart zoom.
const held = new Map();
const between = () => { const [a, b] = [...held.values()]; return Math.hypot(a[0] - b[0], a[1] - b[1]); };
canvas.onpointerdown = e => { held.set(e.pointerId, [e.clientX, e.clientY]); canvas.setPointerCapture(e.pointerId); };
canvas.onpointerup = canvas.onpointercancel = e => { held.delete(e.pointerId); };
canvas.oncontextmenu = e => e.preventDefault();
canvas.onpointermove = e => {
  const before = held.get(e.pointerId);
  if (!before) return;
  const two = held.size === 2, apart = two ? between() : 0, dx = e.clientX - before[0], dy = e.clientY - before[1];
  held.set(e.pointerId, [e.clientX, e.clientY]);
  if (two) away = Math.max(0.05, away * apart / Math.max(between(), 1));
  if (two || e.shiftKey || e.buttons === 2) {
    const s = (two ? 1 : 2) * away / F / canvas.clientHeight, [right, down] = turn();
    for (let k = 0; k < 3; k++) centre[k] -= s * (dx * right[k] + dy * down[k]);
  } else { yaw += dx * 0.006; pitch = Math.max(-1.57, Math.min(1.57, pitch - dy * 0.006)); }
  move();
};
canvas.addEventListener("wheel", e => { e.preventDefault(); away = Math.max(0.05, away * Math.exp(e.deltaY * 0.001)); move(); }, { passive: false });
by("mode").onclick = () => {
  mode = 1 - mode; by("mode").textContent = mode ? "show colour" : "show σ"; by("sigmas").hidden = !mode; draw();
};
by("path").onclick = () => { withPath = !withPath; by("path").textContent = withPath ? "hide path" : "show path"; draw(); };
by("home").onclick = () => { home(); draw(); };
const stamp = () => { by("stamp").textContent = frames ? `${seconds[+when.value].toFixed(2)} s` : "no pose"; };
when.oninput = () => { stamp(); move(); };
addEventListener("resize", draw);
home(); stamp();
if (location.hash === "#sigma") by("mode").onclick();
paint(n);
})();
