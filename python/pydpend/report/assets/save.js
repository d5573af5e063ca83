// What is seen of a chart as PNG, SVG or CSV, and tables as CSV or LaTeX. Needs report.js; asks nothing of a network.
"use strict";
(() => {
  const { charts, array, css } = window.pydpendReport;
  const chartOf = (id) => charts().find((c) => c.spec.id === id);
  const cell = (text) => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
  const escaped = (text) => text.replace(/[&<>"]/g, (c) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" }[c]));

  function save(name, content, type) {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(content instanceof Blob ? content : new Blob([content], { type }));
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  }

  // First and last index of the samples in view, one more on either side so that curves reach the edges.
  function view({ u }, more) {
    const { min, max } = u.scales.x, x = u.data[0];
    let a = x.findIndex((t) => t >= min), b = x.findLastIndex((t) => t <= max);
    if (a < 0 || b < 0) return [0, -1];
    return [Math.max(0, a - more), Math.min(x.length - 1, b + more)];
  }

  function csv(c) {
    const { spec, u } = c;
    if (spec.kind === "status") {
      const { min, max } = u.scales.x, words = ["missing", "seen", "reacquired", "ambiguous", "undecoded"];
      const rows = spec.nodes.flatMap((node, n) => spec.runs[n].filter(([, from, to]) => to >= min && from <= max)
        .map(([code, from, to]) => [cell(node), words[code], from, to].join(",")));
      return ["marker,status,from_s,to_s", ...rows, ""].join("\n");
    }
    const [a, b] = view(c, 0);
    const rows = [[spec.x_label, ...spec.series.map((s, i) => s.label || `lower edge of ${spec.series[i - 1].label}`)].map(cell).join(",")];
    for (let i = a; i <= b; i++) rows.push(u.data.map((column) => column[i] ?? "").join(","));
    return [...rows, ""].join("\n");
  }

  // The canvas on the page's ground, with the title and the names of the curves above it.
  function png(c) {
    const ratio = devicePixelRatio, from = c.u.ctx.canvas, above = Math.round(44 * ratio);
    const to = document.createElement("canvas");
    to.width = from.width; to.height = from.height + above;
    const ctx = to.getContext("2d");
    ctx.fillStyle = css("--ground");
    ctx.fillRect(0, 0, to.width, to.height);
    ctx.drawImage(from, 0, above);
    ctx.fillStyle = css("--ink");
    ctx.font = `600 ${14 * ratio}px system-ui, sans-serif`;
    ctx.fillText(c.spec.title, 8 * ratio, 18 * ratio);
    ctx.font = `${12 * ratio}px system-ui, sans-serif`;
    let x = 8 * ratio;
    for (const s of named(c)) {
      ctx.strokeStyle = s.stroke; ctx.lineWidth = 2 * ratio;
      ctx.setLineDash(s.dash ? [6 * ratio, 4 * ratio] : []);
      ctx.beginPath(); ctx.moveTo(x, 34 * ratio); ctx.lineTo(x + 22 * ratio, 34 * ratio); ctx.stroke();
      ctx.fillText(s.label, x + 27 * ratio, 38 * ratio);
      x += 45 * ratio + ctx.measureText(s.label).width;
    }
    return new Promise((done) => to.toBlob(done, "image/png"));
  }

  // Series as they are drawn: colour, dashes, name.
  const drawn = (c) => c.spec.series.map((s) => ({
    label: s.label, stroke: s.color === undefined ? css("--ink") : css(`--s${s.color % 6}`), dash: s.dashed || s.edge, points: s.points,
    hidden: s.color === undefined && !s.edge,
  }));
  const named = (c) => drawn(c).filter((s) => s.label);

  // Whole steps of 1, 2 or 5 times a power of ten.
  function ticks(min, max, count) {
    const raw = (max - min) / count, power = 10 ** Math.floor(Math.log10(raw));
    const step = power * [1, 2, 5, 10].find((k) => k * power >= raw);
    const out = [];
    for (let k = Math.ceil(min / step); k * step <= max; k++) out.push(k * step);
    return out;
  }

  function svg(c) {
    const { spec, u } = c, W = 720, H = spec.height + 60, left = 70, right = 12, top = 48, bottom = 40;
    const { min, max } = u.scales.x, { min: low, max: high } = u.scales.y;
    const X = (v) => left + (v - min) / (max - min) * (W - left - right), Y = (v) => H - bottom - (v - low) / (high - low) * (H - top - bottom);
    const at = (x, y) => `${x.toFixed(2)} ${y.toFixed(2)}`;
    const ink = css("--ink"), map = spec.kind === "status", out = [];
    const text = (x, y, said, more = "") => out.push(`<text x="${x.toFixed(1)}" y="${y.toFixed(1)}" ${more}>${escaped(said)}</text>`);
    for (const t of ticks(min, max, 8)) {
      out.push(`<path d="M${at(X(t), top)}V${H - bottom}" stroke="${css("--grid")}"/>`);
      text(X(t), H - bottom + 15, window.pydpendReport.numeral(t), 'text-anchor="middle"');
    }
    if (!map) for (const t of ticks(low, high, 5)) {
      out.push(`<path d="M${at(left, Y(t))}H${W - right}" stroke="${css("--grid")}"/>`);
      text(left - 6, Y(t) + 4, window.pydpendReport.numeral(t), 'text-anchor="end"');
    }
    out.push(`<clipPath id="plot"><path d="M${left} ${top}H${W - right}V${H - bottom}H${left}Z"/></clipPath><g clip-path="url(#plot)">`);
    if (map) rows(c, X, Y, out); else curves(c, X, Y, at, out);
    out.push("</g>");
    if (map) spec.nodes.forEach((node, n) => text(left - 6, Y(spec.nodes.length - n - 0.5) + 4, node, 'text-anchor="end"'));
    text(8, 18, spec.title, 'font-weight="600" font-size="14"');
    let x = 8;
    for (const s of map ? [] : named(c)) {
      out.push(`<path d="M${x} 34h22" stroke="${s.stroke}" stroke-width="2"${s.dash ? ' stroke-dasharray="6 4"' : ""}/>`);
      text(x + 27, 38, s.label);
      x += 45 + 6.6 * s.label.length;
    }
    text((left + W - right) / 2, H - 8, spec.x_label, 'text-anchor="middle"');
    text(0, 0, spec.y_label || "", `text-anchor="middle" transform="translate(16 ${(top + H - bottom) / 2}) rotate(-90)"`);
    return `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 ${W} ${H}" width="${W}" height="${H}" fill="none" font-family="sans-serif" font-size="12">`
      + `<path fill="${css("--ground")}" d="M0 0h${W}v${H}H0Z"/><g fill="${ink}" stroke-width="1">${out.join("\n")}</g></svg>\n`;
  }

  function rows(c, X, Y, out) {
    const { spec } = c, colors = ["--line", "--s2", "--s0", "--s1", "--s3"];
    spec.nodes.forEach((_, n) => {
      const y = Y(spec.nodes.length - n - 0.12), h = Y(spec.nodes.length - n - 0.88) - y;
      for (const [code, from, to] of spec.runs[n]) {
        out.push(`<path fill="${css(colors[code])}" d="M${X(from).toFixed(2)} ${y.toFixed(2)}H${Math.max(X(to), X(from) + 0.5).toFixed(2)}v${h.toFixed(2)}H${X(from).toFixed(2)}Z"/>`);
      }
    });
  }

  function curves(c, X, Y, at, out) {
    const { spec, u } = c, [a, b] = view(c, 1), x = u.data[0], column = (k) => u.data[k + 1];
    spec.series.forEach((s, k) => {
      if (!s.band) return;
      const [i, j] = [k + s.band[0], k + s.band[1]], there = [], back = [];
      for (let n = a; n <= b; n++) if (column(i)[n] != null && column(j)[n] != null) { there.push(at(X(x[n]), Y(column(i)[n]))); back.unshift(at(X(x[n]), Y(column(j)[n]))); }
      if (there.length) out.push(`<path fill-opacity="0.12" d="M${[...there, ...back].join("L")}Z"/>`);
    });
    drawn(c).forEach((s, k) => {
      if (s.hidden) return;
      let d = "", pen = false;
      for (let n = a; n <= b; n++) {
        const y = column(k)[n];
        if (y == null) { pen = false; continue; }
        const place = at(X(x[n]), Y(y));
        if (s.points) out.push(`<circle r="2" fill="${s.stroke}" cx="${X(x[n]).toFixed(2)}" cy="${Y(y).toFixed(2)}"/>`);
        else { d += (pen ? "L" : "M") + place; pen = true; }
      }
      if (d) out.push(`<path fill="none" stroke="${s.stroke}" stroke-width="1.25"${s.dash ? ' stroke-dasharray="6 4"' : ""} d="${d}"/>`);
    });
  }

  const cells = (row) => [...row.cells].map((c) => c.textContent.replaceAll("\u00a0", " ").trim());
  function latex(table) {
    const sign = { "\\": "\\textbackslash{}", "~": "\\textasciitilde{}", "^": "\\textasciicircum{}", "±": "$\\pm$", "−": "$-$", "×": "$\\times$", "–": "--", "²": "$^2$" };
    const up = "⁰¹²³⁴⁵⁶⁷⁸⁹";
    const tex = (text) => text.replace(/⁻?[⁰¹³⁴-⁹]+|⁻²|[\\~^±−×–²&%$#_{}]/g, (c) => sign[c]
      ?? (/[&%$#_{}]/.test(c) ? `\\${c}` : `$^{${[...c].map((d) => (d === "⁻" ? "-" : up.indexOf(d))).join("")}}$`));
    const lines = [...table.rows].map((row) => `${cells(row).map(tex).join(" & ")} \\\\`);
    const columns = [...table.rows[0].cells].map((c) => (c.classList.contains("number") ? "r" : "l")).join("");
    return [`\\begin{tabular}{${columns}}`, "\\hline", lines[0], "\\hline", ...lines.slice(1), "\\hline", "\\end{tabular}", ""].join("\n");
  }

  const tables = [...document.querySelectorAll(".tools[data-table]")];
  document.addEventListener("click", async (e) => {
    const button = e.target.closest?.("button[data-save]");
    if (!button) return;
    const tools = button.parentNode, form = button.dataset.save;
    if ("table" in tools.dataset) {
      const table = tools.previousElementSibling.querySelector("table"), name = `table-${tables.indexOf(tools) + 1}`;
      if (form === "csv") save(`${name}.csv`, [...table.rows].map((r) => cells(r).map(cell).join(",")).join("\n") + "\n", "text/csv");
      else save(`${name}.tex`, latex(table), "text/x-tex");
      return;
    }
    const c = chartOf(tools.dataset.chart), name = tools.dataset.chart;
    if (form === "csv") save(`${name}.csv`, csv(c), "text/csv");
    else if (form === "svg") save(`${name}.svg`, svg(c), "image/svg+xml");
    else save(`${name}.png`, await png(c));
  });

  // The film's first picture stands in its tile.
  for (const still of document.querySelectorAll(".still[data-film]")) {
    const video = document.querySelector(`#${CSS.escape(still.dataset.film)} video`);
    const draw = () => {
      const canvas = document.createElement("canvas");
      canvas.width = video.videoWidth; canvas.height = video.videoHeight;
      canvas.setAttribute("role", "img");
      canvas.setAttribute("aria-label", "First picture of the film, with what was found");
      canvas.getContext("2d").drawImage(video, 0, 0);
      still.replaceChildren(canvas);
    };
    if (video.readyState >= 2) draw(); else video.addEventListener("loadeddata", draw, { once: true });
  }
})();
