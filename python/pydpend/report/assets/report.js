// The report's plots, the film beside them, and one cursor for all. Needs uPlot; asks nothing of a network.
"use strict";
(() => {
  const data = JSON.parse(document.getElementById("report-data").textContent);
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const STATUS = { missing: "--line", seen: "--s2", reacquired: "--s0", ambiguous: "--s1", undecoded: "--s3", manual: "--s4" };
  const STATUS_BY_CODE = ["missing", "seen", "reacquired", "ambiguous", "undecoded", "manual"];

  // Arrays are base64 of little-endian float32, or float64 where the name starts with "d".
  const cache = new Map();
  function numbers(key) {
    if (!cache.has(key)) {
      const raw = atob(data.arrays[key]);
      const bytes = new Uint8Array(raw.length);
      for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
      cache.set(key, key[0] === "d" ? new Float64Array(bytes.buffer) : new Float32Array(bytes.buffer));
    }
    return cache.get(key);
  }
  // NaN is a gap, which uPlot calls null.
  const plain = new Map();
  function array(key) {
    if (!plain.has(key)) plain.set(key, Array.from(numbers(key), (v) => (Number.isNaN(v) ? null : v)));
    return plain.get(key);
  }
  const firstAt = (times, time) => {
    let lo = 0, hi = times.length;
    while (lo < hi) { const mid = (lo + hi) >> 1; if (times[mid] < time) lo = mid + 1; else hi = mid; }
    return lo;
  };

  // Charts of one group share their time range and their cursor.
  const groups = new Map();
  function group(name) {
    if (!groups.has(name)) groups.set(name, { charts: [], range: null, film: null, time: null, frame: 0, rest: 0 });
    return groups.get(name);
  }

  // However many times a hand moves between two pictures, a chart is drawn once; one out of sight when the hand rests.
  const inSight = new Set();
  const sight = new IntersectionObserver((seen) => {
    for (const s of seen) { if (s.isIntersecting) inSight.add(s.target); else inSight.delete(s.target); }
  }, { rootMargin: "200px" });

  function setRange(g, min, max) {
    g.range = [min, max];
    if (!g.frame) g.frame = requestAnimationFrame(() => {
      g.frame = 0;
      draw(g, (c) => inSight.has(c.root.parentNode));
      clearTimeout(g.rest);
      g.rest = setTimeout(() => draw(g, () => true), 150);
    });
  }

  function draw(g, wanted) {
    const [min, max] = g.range;
    for (const c of g.charts) {
      if (wanted(c) && (c.scales.x.min !== min || c.scales.x.max !== max)) c.setScale("x", { min, max });
    }
    if (g.time !== null) putCursor(g, g.time);
  }

  function full(g) {
    let min = Infinity, max = -Infinity;
    for (const c of g.charts) {
      const x = c.data[0];
      if (x.length) { min = Math.min(min, x[0]); max = Math.max(max, x[x.length - 1]); }
    }
    return [min, max];
  }

  // As wide as asked for and not beyond what there is.
  function setWithin(g, a, b) {
    const [lo, hi] = full(g);
    if (b - a >= hi - lo) { a = lo; b = hi; }
    if (a < lo) { b += lo - a; a = lo; }
    if (b > hi) { a -= b - hi; b = hi; }
    setRange(g, a, b);
  }

  function putCursor(g, time) {
    g.time = time;
    for (const c of g.charts) {
      const left = c.valToPos(time, "x");
      if (Number.isFinite(left)) c.setCursor({ left, top: -10 }, false);
    }
  }

  function gotoTime(g, time) {
    putCursor(g, time);
    if (g.film) g.film.seek(time);
  }

  function statusMap(spec) {
    return (u) => {
      const { ctx } = u, nodes = spec.nodes;
      const top = u.bbox.top, height = u.bbox.height / nodes.length;
      const t = numbers(spec.t), { min, max } = u.scales.x;
      const first = Math.max(0, firstAt(t, min) - 1), last = Math.min(t.length, firstAt(t, max) + 1);
      ctx.save();
      ctx.beginPath();
      ctx.rect(u.bbox.left, u.bbox.top, u.bbox.width, u.bbox.height);
      ctx.clip();
      for (let n = 0; n < nodes.length; n++) {
        for (const [code, from, to] of spec.runs[n]) {
          const x0 = u.valToPos(from, "x", true), x1 = Math.max(u.valToPos(to, "x", true), x0 + devicePixelRatio);
          if (x1 < u.bbox.left || x0 > u.bbox.left + u.bbox.width) continue;
          ctx.fillStyle = css(STATUS[STATUS_BY_CODE[code]]);
          ctx.fillRect(x0, top + n * height + height * 0.12, x1 - x0, height * 0.76);
        }
        if (spec.residual.length) residual(u, numbers(spec.residual[n]), t, first, last, top + (n + 0.88) * height, 0.76 * height / spec.full);
      }
      ctx.restore();
    };
  }

  // One bar a pixel column, as high as the largest residual in it.
  function residual(u, values, t, first, last, base, scale) {
    const { ctx } = u, roof = 0.76 * u.bbox.height / u.scales.y.max;
    const to = u.bbox.left + u.bbox.width, perS = u.bbox.width / (u.scales.x.max - u.scales.x.min);
    ctx.fillStyle = css("--ink");
    let column = -1, most = 0;
    const bar = () => { if (column >= u.bbox.left && column <= to) ctx.fillRect(column, base - Math.min(roof, most * scale), 1, Math.min(roof, most * scale)); };
    for (let i = first; i < last; i++) {
      const x = Math.round(u.bbox.left + (t[i] - u.scales.x.min) * perS);
      if (x !== column) { bar(); column = x; most = 0; }
      if (values[i] > most) most = values[i];
    }
    bar();
  }

  // As in the tables, in every country.
  const numeral = (v) => (v == null ? "" : String(+v.toPrecision(10)).replace("-", "−"));

  function options(spec, width, g) {
    const ink = css("--ink"), grid = { stroke: css("--grid"), width: 1 };
    const axis = { stroke: ink, values: (u, splits) => splits.map(numeral), grid, ticks: grid, font: "12px system-ui, sans-serif", labelFont: "12px system-ui, sans-serif", labelSize: 18 };
    const series = [{ label: spec.x_label, value: (u, v) => (v == null ? "–" : v.toFixed(4)) }];
    const bands = [];
    for (const s of spec.series) {
      const stroke = s.color === undefined ? "transparent" : css(`--s${s.color % 6}`);
      series.push({
        label: s.label, class: s.label ? null : "unnamed", stroke: s.edge ? ink : stroke, width: s.points ? 0 : s.edge ? 0.75 : 1.25,
        points: s.points ? { show: true, size: 4, fill: stroke, stroke } : { show: false },
        value: (u, v) => (v == null ? "–" : v.toPrecision(6)), scale: "y", spanGaps: false, dash: s.dashed || s.edge ? [6, 4] : undefined,
      });
      if (s.band) bands.push({ series: [series.length - 1 + s.band[0], series.length - 1 + s.band[1]], fill: ink + "20" });
    }
    const map = spec.kind === "status";
    return {
      width, height: spec.height || 240, title: spec.title, series, bands,
      scales: { x: { time: false }, y: map ? { range: () => [0, spec.nodes.length] } : spec.y_range ? { range: () => spec.y_range } : {} },
      axes: [
        { ...axis, label: spec.x_label, size: 34 },
        { ...axis, label: spec.y_label, size: 64,
          ...(map ? { splits: () => spec.nodes.map((_, i) => spec.nodes.length - i - 0.5), values: () => spec.nodes } : {}) },
      ],
      // Less than 5 px is a click, also where the cursor was set by the film in between. With Shift a drag moves.
      cursor: {
        drag: { x: true, y: false, dist: 5, setScale: false }, sync: { key: spec.group }, focus: { prox: -1 }, y: false,
        bind: {
          mousedown: (u, over, handle) => (e) => { if (e.button === 0 && !e.shiftKey && e.target === over) handle(e); },
          dblclick: () => () => { setRange(g, ...full(g)); },
        },
      },
      legend: { show: !map, live: true, markers: { dash: (u, i) => (u.series[i].dash ? "dashed" : "solid") } },
      hooks: {
        setSelect: [(u) => {
          const { left, width } = u.select;
          if (!width) return;
          u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
          setWithin(g, u.posToVal(left, "x"), u.posToVal(left + width, "x"));
        }],
        draw: map ? [statusMap(spec)] : [],
      },
    };
  }

  function wheel(u, g) {
    u.over.addEventListener("wheel", (e) => {
      if (!(e.ctrlKey || e.shiftKey || e.altKey)) return; // plain scrolling scrolls the page
      e.preventDefault();
      const [min, max] = g.range, at = min + (max - min) * e.offsetX / u.over.clientWidth;
      let a, b;
      if (e.shiftKey) {
        const shift = ((e.deltaY || e.deltaX) > 0 ? 0.1 : -0.1) * (max - min);
        a = min + shift; b = max + shift;
      } else {
        const f = e.deltaY > 0 ? 1.25 : 0.8;
        a = at - (at - min) * f; b = at + (max - at) * f;
      }
      setWithin(g, a, b);
    }, { passive: false });
  }

  function drag(u, g) {
    u.over.addEventListener("mousedown", (e) => {
      if (e.button !== 0 || !e.shiftKey) return;
      e.preventDefault();
      const [min, max] = g.range, from = e.clientX, scale = (max - min) / u.over.clientWidth;
      const move = (m) => setWithin(g, min - (m.clientX - from) * scale, max - (m.clientX - from) * scale);
      addEventListener("mousemove", move);
      addEventListener("mouseup", () => removeEventListener("mousemove", move), { once: true });
    });
  }

  // Two fingers zoom, one moves; up and down scrolls the page.
  function touch(u, g) {
    const fingers = new Map();
    let begun = null;
    const begin = () => { begun = { min: g.range[0], max: g.range[1], at: [...fingers.values()] }; };
    u.over.addEventListener("pointerdown", (e) => {
      if (e.pointerType === "touch" && fingers.size < 2) { fingers.set(e.pointerId, e.clientX); begin(); }
    });
    u.over.addEventListener("pointermove", (e) => {
      if (!fingers.has(e.pointerId)) return;
      fingers.set(e.pointerId, e.clientX);
      const now = [...fingers.values()], { left, width } = u.over.getBoundingClientRect();
      let scale = (begun.max - begun.min) / width;
      // The time under a finger stays under it.
      const held = begun.at.map((x) => begun.min + (x - left) * scale);
      if (now.length === 2) scale = (held[1] - held[0]) / (now[1] - now[0]);
      if (!(scale > 0) || !Number.isFinite(scale)) return;
      const a = held[0] - (now[0] - left) * scale;
      setWithin(g, a, a + width * scale);
    });
    for (const end of ["pointerup", "pointercancel"]) {
      u.over.addEventListener(end, (e) => { if (fingers.delete(e.pointerId)) begin(); });
    }
  }

  function build(spec) {
    const host = document.getElementById(spec.id);
    const g = group(spec.group);
    const columns = [array(spec.x), ...spec.series.map((s) => array(s.y))];
    const u = new uPlot(options(spec, host.clientWidth, g), columns, host);
    g.charts.push(u);
    sight.observe(host);
    wheel(u, g);
    drag(u, g);
    touch(u, g);
    let down = null;
    u.over.addEventListener("mousedown", (e) => { down = e.clientX; });
    u.over.addEventListener("mouseup", (e) => {
      if (down !== null && Math.abs(e.clientX - down) < 4) gotoTime(g, u.posToVal(e.offsetX, "x"));
      down = null;
    });
    // Once the mouse has gone, the cursor is the film's again.
    u.over.addEventListener("mouseleave", () => setTimeout(() => { if (g.film && g.time !== null) putCursor(g, g.time); }));
    host.tabIndex = 0;
    host.setAttribute("role", "img");
    host.addEventListener("keydown", (e) => {
      const [min, max] = g.range, span = max - min;
      if (e.key === "+" || e.key === "=") setRange(g, min + span * 0.1, max - span * 0.1);
      else if (e.key === "-") setWithin(g, min - span * 0.125, max + span * 0.125);
      else if (e.key === "0" || e.key === "Home") setRange(g, ...full(g));
      else if (e.shiftKey && (e.key === "ArrowLeft" || e.key === "ArrowRight")) {
        const by = (e.key === "ArrowLeft" ? -0.1 : 0.1) * span;
        setWithin(g, min + by, max + by);
      } else if ((e.key === "ArrowLeft" || e.key === "ArrowRight") && g.film) g.film.step(e.key === "ArrowLeft" ? -1 : 1);
      else return;
      e.preventDefault();
    });
    return { u, host, spec, g };
  }

  let built = [];
  function rebuild() {
    for (const b of built) { sight.unobserve(b.host); b.u.destroy(); }
    for (const g of groups.values()) g.charts = [];
    built = data.charts.map(build);
    for (const g of groups.values()) {
      if (g.range === null) g.range = full(g);
      draw(g, () => true);
    }
  }

  // The film: frame k of the embedded video shows the recording at times[k].
  function film(spec) {
    const box = document.getElementById(spec.id), video = box.querySelector("video"), out = box.querySelector("output");
    const times = array(spec.times), rate = spec.rate_hz, g = group(spec.group);
    const frameNow = () => Math.min(times.length - 1, Math.max(0, Math.floor(video.currentTime * rate + 1e-3)));
    const nearest = (time) => {
      let lo = 0, hi = times.length - 1;
      while (lo < hi) { const mid = (lo + hi) >> 1; if (times[mid] < time) lo = mid + 1; else hi = mid; }
      return lo > 0 && Math.abs(times[lo - 1] - time) <= Math.abs(times[lo] - time) ? lo - 1 : lo;
    };
    const show = () => {
      const k = frameNow();
      out.textContent = `t = ${times[k].toFixed(4)} s, film frame ${k + 1} of ${times.length}`;
      putCursor(g, times[k]);
    };
    const seekFrame = (k) => { video.currentTime = (Math.min(times.length - 1, Math.max(0, k)) + 0.5) / rate; };
    g.film = {
      seek: (time) => { video.pause(); seekFrame(nearest(time)); },
      step: (d) => { video.pause(); seekFrame(frameNow() + d); },
    };
    video.addEventListener("seeked", show);
    video.addEventListener("loadeddata", show);
    if ("requestVideoFrameCallback" in HTMLVideoElement.prototype) {
      const tick = () => { show(); video.requestVideoFrameCallback(tick); };
      video.requestVideoFrameCallback(tick);
    } else {
      video.addEventListener("timeupdate", show);
    }
    box.addEventListener("keydown", (e) => {
      if (e.key !== "ArrowLeft" && e.key !== "ArrowRight") return;
      g.film.step(e.key === "ArrowLeft" ? -1 : 1);
      e.preventDefault();
    });
    for (const b of box.querySelectorAll("button[data-step]")) {
      b.addEventListener("click", () => g.film.step(Number(b.dataset.step)));
    }
  }

  rebuild();
  data.films.forEach(film);
  for (const b of document.querySelectorAll("button[data-reset]")) {
    b.addEventListener("click", () => { const g = group(b.dataset.reset); setRange(g, ...full(g)); });
  }
  let pending = 0;
  addEventListener("resize", () => {
    cancelAnimationFrame(pending);
    pending = requestAnimationFrame(() => {
      for (const b of built) b.u.setSize({ width: b.host.clientWidth, height: b.spec.height || 240 });
    });
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", rebuild);
  // For tests and for people with a console: the charts and groups as they are.
  window.pydpendReport = { groups, data, array, css, numeral, charts: () => built, ready: true };
})();
