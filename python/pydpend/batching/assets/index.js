"use strict";
// The table of a batch: all rows are data, and as many of them are drawn as have been looked at.
(() => {
  const data = JSON.parse(document.getElementById("batch-data").textContent);
  const AT_A_TIME = 60; // rows that are drawn at once: two or three screens
  const table = document.getElementById("table");
  const body = table.tBodies[0];
  const heads = [...table.tHead.rows[0].cells];
  const form = document.querySelector("form.choose");
  const told = form.querySelector("output");
  const more = document.getElementById("more");
  const SVG = "http://www.w3.org/2000/svg";
  let shown = data.rows;
  let drawn = 0;
  let sorted = { column: -1, down: false };

  const films = "IntersectionObserver" in window ? new IntersectionObserver((seen) => {
    for (const one of seen) {
      if (!one.isIntersecting) continue;
      one.target.src = one.target.dataset.film;
      films.unobserve(one.target);
    }
  }) : null;

  function element(name, classes, text) {
    const made = document.createElement(name);
    if (classes) made.className = classes;
    if (text !== undefined) made.textContent = text;
    return made;
  }

  function vector(name, attributes) {
    const made = document.createElementNS(SVG, name);
    for (const key in attributes) made.setAttribute(key, attributes[key]);
    return made;
  }

  function sketch(row) {
    const [width, height] = row.sketch.size;
    const picture = vector("svg", { class: "sketch", viewBox: `0 0 ${width} ${height}`, role: "img",
      "aria-label": `markers of ${row.name}` });
    row.sketch.bodies.forEach((body, k) => {
      for (const [x, y] of body) picture.append(vector("circle", { cx: x, cy: y, r: 22, class: `b${k % 4}` }));
    });
    return picture;
  }

  function film(row) {
    const shows = element("video");
    Object.assign(shows, { muted: true, playsInline: true, preload: "metadata", loop: true, tabIndex: 0 });
    shows.setAttribute("aria-label", `film of ${row.name} with its markers`);
    shows.dataset.film = row.film;
    const play = () => shows.play().catch(() => {});
    shows.addEventListener("pointerenter", play);
    shows.addEventListener("focus", play);
    shows.addEventListener("pointerleave", () => shows.pause());
    shows.addEventListener("blur", () => shows.pause());
    // A film that cannot be played leaves the markers to be seen.
    shows.addEventListener("error", () => { if (row.sketch) shows.replaceWith(sketch(row)); });
    if (films) films.observe(shows); else shows.src = row.film;
    return shows;
  }

  function curve(row) {
    const known = row.curve.flat().filter((v) => v !== null);
    if (!known.length) return "";
    const low = Math.min(...known);
    const span = Math.max(...known) - low || 1;
    const picture = vector("svg", { class: "curve", viewBox: "0 0 100 40", preserveAspectRatio: "none", role: "img",
      "aria-label": `angles of ${row.name}, from ${low} to ${low + span} deg` });
    row.curve.forEach((values, k) => {
      let points = [];
      const end = () => {
        if (points.length) picture.append(vector("polyline", { points: points.join(" "), class: `b${k % 4}`, style: "fill: none" }));
        points = [];
      };
      values.forEach((v, i) => {
        if (v === null) end();
        else points.push(`${(100 * i / (values.length - 1)).toFixed(1)},${(38 - 36 * (v - low) / span).toFixed(1)}`);
      });
      end();
    });
    return picture;
  }

  function cells(row) {
    const line = element("tr");
    const name = element("th", "name");
    name.scope = "row";
    if (row.report) {
      const link = element("a", "", row.name);
      link.href = row.report;
      name.append(link);
    } else name.append(row.name);
    const state = element("td", "ours");
    state.append(element("span", `light ${row.light}`), data.words[row.light]);
    state.firstChild.setAttribute("aria-hidden", "true");
    const picture = element("td");
    if (row.film) picture.append(film(row)); else if (row.sketch) picture.append(sketch(row));
    const angles = element("td");
    if (row.curve) angles.append(curve(row));
    const why = element("td", "why");
    if (row.why !== null) why.append(element("div", "", data.texts[row.why]));
    line.append(name, state, picture, angles, why);
    row.shown.forEach((text) => line.append(element("td", "number", text)));
    return line;
  }

  function draw() {
    const next = shown.slice(drawn, drawn + AT_A_TIME);
    body.append(...next.map(cells));
    drawn += next.length;
    more.hidden = drawn >= shown.length;
  }

  function redraw() {
    body.replaceChildren();
    drawn = 0;
    told.textContent = `${shown.length} of ${data.rows.length} recordings`;
    draw();
  }

  function choose() {
    const lights = new Set([...form.elements.light].filter((box) => box.checked).map((box) => box.value));
    const words = form.elements.text.value.trim().toLowerCase();
    const kind = form.elements.warning.value;
    shown = data.rows.filter((row) => lights.has(row.light)
      && (kind === "" || row.kinds.includes(Number(kind)))
      && (!words || row.name.toLowerCase().includes(words)
        || (row.why !== null && data.texts[row.why].toLowerCase().includes(words))));
    order();
    redraw();
  }

  const LIGHTS = { red: 0, yellow: 1, green: 2 };

  function value(row, column) {
    if (column === 0) return row.name;
    if (column === 1) return LIGHTS[row.light];
    if (column === 4) return row.why === null ? "" : data.texts[row.why];
    return row.values[column - 5];
  }

  const words = new Intl.Collator(undefined, { numeric: true });

  function order() {
    if (sorted.column < 0) return;
    const way = sorted.down ? -1 : 1;
    shown = shown.map((row) => [value(row, sorted.column), row]).sort(([a], [b]) => {
      // What has no value stands at the end either way.
      if (a === null || b === null) return (a === null) - (b === null);
      return way * (typeof a === "string" ? words.compare(a, b) : a - b);
    }).map(([, row]) => row);
  }

  heads.forEach((head, column) => {
    const button = head.querySelector("button");
    if (!button) return;
    button.addEventListener("click", () => {
      sorted = { column, down: sorted.column === column && !sorted.down };
      heads.forEach((other) => other.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", sorted.down ? "descending" : "ascending");
      order();
      redraw();
    });
  });
  form.addEventListener("input", choose);
  form.addEventListener("submit", (event) => event.preventDefault());
  more.querySelector("button").addEventListener("click", draw);
  const frame = document.querySelector(".wide");
  frame.addEventListener("scroll", () => {
    if (!more.hidden && frame.scrollTop + 2 * frame.clientHeight > frame.scrollHeight) draw();
  });
  redraw();
})();
