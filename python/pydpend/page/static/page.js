// The page: one state, one frame, one step; the parts draw from it and change it through the server.
import { ask, change, enter, leave } from "./api.js";
import { Film } from "./film.js";
import { View, box, cross, label, nodes as drawNodes, ring, unit } from "./draw.js";
import { steps } from "./steps.js";
import { gapMap } from "./check.js";
import { listen } from "./keys.js";

const $ = (id) => document.getElementById(id);

export const app = {
  state: null, frame: 0, step: "film", node: null, version: -1, playing: false,
  film: new Film(), view: new View($("film")), picture: null, row: null, shown: -1,
  detections: null, looks: false, threshold: null, cursor: null, dragging: null, boxing: null, sigma: 1, spread: "doubt",

  get table() { return this.state?.table ?? null; },
  get names() { return this.table ? this.table.nodes.map((n) => n.name) : []; },
  get bodies() { return this.table ? this.table.nodes.map((n) => this.table.bodies.indexOf(n.body)) : []; },
  get last() { return this.table ? this.table.last : Math.max(0, (this.state?.film.frames ?? 1) - 1); },
  get first() { return this.table ? this.table.first : 0; },

  // Goes to a frame: the newest wish wins, so that a held key steps as fast as pictures come.
  async go(frame) {
    frame = Math.round(Math.min(Math.max(frame, 0), Math.max(this.last, (this.state?.film.frames ?? 1) - 1)));
    this.frame = frame;
    $("frame").value = frame; $("slider").value = frame;
    if (this.loading) { this.again = true; return; }
    this.loading = true;
    const slow = setTimeout(() => $("stage").setAttribute("aria-busy", "true"), 200);
    try {
      do {
        this.again = false;
        const at = this.frame;
        const [picture, row] = await Promise.all([this.film.picture(at), this.film.row(at)]);
        if (this.wantsDetections) this.detections = await ask(`detections/${at}`, { threshold: this.threshold ?? this.state.choice.threshold, node: this.step === "check" ? this.node : null });
        Object.assign(this, { picture, row, shown: at });
        this.paint();
      } while (this.again || this.frame !== this.shown);
    } catch (problem) { this.tell(problem.message); }
    clearTimeout(slow);
    $("stage").removeAttribute("aria-busy");
    this.loading = false;
    if (this.step === "check") steps.show(this);
    for (let k = 1; k <= 4; k++) if (this.frame + k <= this.last) this.film.picture(this.frame + k).catch(() => {});
    steps.frameChanged(this);
  },

  get wantsDetections() { return this.looks || this.step === "check" && this.node !== null; },

  look() { this.detections = null; this.go(this.frame); },

  paint() {
    const { view, state } = this;
    if (!state) return;
    const film = state.film;
    if (view.fitted) view.fit(film.width, film.height);
    view.draw(this.picture, film, (context) => {
      if (this.wantsDetections && this.detections) {
        this.detections.found.forEach(([x, y, , area], k) => {
          const at = view.toScreen([x, y]);
          ring(context, at, Math.max(4, Math.sqrt(area / Math.PI) * view.scale + 2), "#ffffff", 1);
          if (this.step === "check" && k < 9) label(context, String(k + 1), at[0] - 4 * unit(), at[1] - 17 * unit(), "#ffffff", 15);
        });
        if (this.step === "check" && this.detections.expected) cross(context, view.toScreen(this.detections.expected), 9, "#ff80ff", 1);
      }
      drawNodes(context, view, this.row, this.names, this.bodies, this.node);
      if (this.step === "markers") {
        state.choice.marker.forEach(([x, y, f], k) => {
          if (f !== this.frame) return;
          cross(context, view.toScreen([x, y]), 12, "#ff80ff");
        });
        for (const c of state.work.candidates) {
          if (c.frame === this.frame) { ring(context, view.toScreen([c.x, c.y]), 14, "#ffd060"); label(context, String(c.number), view.toScreen([c.x, c.y])[0] + 17, view.toScreen([c.x, c.y])[1], "#ffd060", 15); }
        }
      }
      const region = this.boxing?.to ? [...this.boxing.from, ...this.boxing.to] : (state.choice.region ?? "").split(",").map(Number);
      if (region.length === 4) box(context, view.toScreen(region.slice(0, 2)), view.toScreen(region.slice(2)), "#6cb6ff");
      if (this.dragging?.to) cross(context, view.toScreen(this.dragging.to), 12, "#ffffff");
      if (this.cursor) cross(context, view.toScreen(this.cursor), 16, "#ffffff");
    });
    $("film").setAttribute("aria-label", `Frame ${this.frame} of ${film.name}`);
  },

  // What a click means in the step: follow this, or the chosen marker is here.
  async point(place) {
    const [x, y] = place, { width, height } = this.state.film;
    if (x < -0.5 || y < -0.5 || x > width - 0.5 || y > height - 0.5) return;
    if (this.step === "markers") {
      const marker = [...this.state.choice.marker, [Math.round(x * 10) / 10, Math.round(y * 10) / 10, this.frame]];
      await this.choose({ marker });
    } else if (this.step === "check" && this.node !== null) {
      await this.decide({ what: "place", node: this.node, frame: this.frame, at_px: [x, y], sigma_px: this.sigma });
    }
  },

  async act(path, said) {
    try { this.take(await change(path, said)); this.tell(null); }
    catch (problem) { this.tell(problem.message); if (problem.status === 409) await this.poll(); }
    await this.go(this.frame);
  },
  choose(said) { return this.act("choose", said); },
  decide(said) { return this.act("decide", said); },
  undo() { return this.act("undo"); },
  arrange(said) { return this.act("arrange", said); },

  tell(problem) {
    this.problem = problem;
    const text = problem ?? this.state?.work.problem ?? null;
    $("problem").hidden = !text;
    if ($("problem").textContent !== (text ?? "")) $("problem").textContent = text ?? "";
  },

  take(state) {
    const before = this.state;
    this.state = state;
    const fresh = state.version !== this.version;
    this.version = state.version;
    this.film.setVersion(state.version);
    if (this.node !== null && !this.names.includes(this.node)) this.node = null;
    if (this.node === null && this.names.length) this.node = this.names[0];
    const { film, work, table } = state;
    document.title = `${film.name} – pydpend edit`;
    $("title").textContent = film.name;
    const part = work.total ? ` ${Math.round(100 * work.done / work.total)} %` : work.done ? ` ${work.done} frames` : "";
    const told = work.busy ? `Tracking: ${work.stage}${part}` : work.problem ? "Nothing is followed yet" : table ? `${table.nodes.length} markers in ${table.frames} frames; saved` : "";
    if ($("work").textContent !== told) $("work").textContent = told;
    this.tell(this.problem);
    const most = Math.max(this.last, (film.frames ?? 1) - 1);
    $("slider").max = most; $("frame").max = most;
    const steady = before && JSON.stringify({ ...before, work: null }) === JSON.stringify({ ...state, work: null })
      && JSON.stringify(before.work.candidates) === JSON.stringify(work.candidates) && before.work.busy === work.busy;
    if (!steady) { steps.show(this); gapMap(this, $("map")); }
    if (fresh && before) this.go(this.frame);
  },

  async poll() {
    try { this.take(await ask("state")); }
    catch (problem) { this.tell(problem.status ? problem.message : "The program has ended. Your decisions are in the file."); }
  },

  enter(step) {
    this.step = step; this.detections = null; this.cursor = null;
    steps.show(this, true);
    this.go(this.frame);
  },

  chooseNode(name) {
    this.node = name;
    steps.show(this); gapMap(this, $("map")); this.look();
  },
};

function pointer() {
  const canvas = $("film"), at = (e) => { const b = canvas.getBoundingClientRect(); return [e.clientX - b.left, e.clientY - b.top]; };
  let from = null, last = null;
  canvas.addEventListener("pointerdown", (e) => {
    canvas.setPointerCapture(e.pointerId);
    from = last = at(e);
    if (app.boxing) app.boxing.from = app.view.toFilm(from);
    else if (app.step === "check" && app.row && e.button === 0) {
      const near = app.row.findIndex(([x, y]) => x !== null && Math.hypot(...app.view.toScreen([x, y]).map((v, k) => v - from[k])) < 12);
      if (near >= 0) app.dragging = { node: app.names[near] };
    }
  });
  canvas.addEventListener("pointermove", (e) => {
    if (!from) return;
    const now = at(e);
    if (app.boxing?.from) app.boxing.to = app.view.toFilm(now);
    else if (app.dragging) app.dragging.to = app.view.toFilm(now);
    else if (Math.hypot(now[0] - from[0], now[1] - from[1]) > 4 || app.panning) {
      app.panning = true; app.view.fitted = false;
      app.view.x += now[0] - last[0]; app.view.y += now[1] - last[1];
    }
    last = now;
    app.paint();
  });
  canvas.addEventListener("pointerup", (e) => {
    const now = at(e), moved = from && Math.hypot(now[0] - from[0], now[1] - from[1]) > 4;
    const { dragging, boxing, panning } = app;
    Object.assign(app, { dragging: null, panning: false });
    from = null;
    if (boxing?.to) {
      app.boxing = null;
      const [a, b] = [boxing.from, boxing.to], clamp = (v, most) => Math.min(Math.max(Math.round(v), 0), most);
      const { width, height } = app.state.film;
      app.choose({ region: [clamp(Math.min(a[0], b[0]), width - 1), clamp(Math.min(a[1], b[1]), height - 1), clamp(Math.max(a[0], b[0]), width - 1), clamp(Math.max(a[1], b[1]), height - 1)].join(",") });
    } else if (dragging && moved) {
      app.node = dragging.node;
      app.point(app.view.toFilm(now));
    } else if (dragging) app.chooseNode(dragging.node);
    else if (!panning && e.button === 0) app.point(app.view.toFilm(now));
    app.paint();
  });
  canvas.addEventListener("wheel", (e) => {
    e.preventDefault();
    app.view.zoom(Math.exp(-e.deltaY / 400), at(e));
    app.paint();
  }, { passive: false });
}

async function play() {
  app.playing = !app.playing;
  $("play").textContent = app.playing ? "Stop" : "Play";
  while (app.playing && app.frame < app.last) {
    const next = new Promise((done) => setTimeout(done, 33));
    await app.go(app.frame + 1);
    await next;
  }
  app.playing = false;
  $("play").textContent = "Play";
}

async function begin() {
  steps.build(app);
  try { await enter(); app.take(await ask("state")); }
  catch (problem) { app.tell(problem.message); return; }
  pointer();
  listen(app, play);
  $("play").addEventListener("click", play);
  $("fit").addEventListener("click", () => { app.view.fitted = true; app.paint(); });
  $("frame").addEventListener("change", () => app.go(Number($("frame").value)));
  $("slider").addEventListener("input", () => app.go(Number($("slider").value)));
  for (const b of document.querySelectorAll("[data-go]")) b.addEventListener("click", () => app.go(app.frame + Number(b.dataset.go)));
  new ResizeObserver(() => { app.paint(); gapMap(app, $("map")); }).observe($("stage"));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => gapMap(app, $("map")));
  addEventListener("pagehide", leave);
  await app.go(app.first);
  window.pydpendEdit = app;
  for (;;) {
    await new Promise((done) => setTimeout(done, app.state.work.busy ? 300 : 1500));
    await app.poll();
  }
}

begin();
