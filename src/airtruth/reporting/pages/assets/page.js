"use strict";
(() => {
  const root = document.documentElement;
  const shade = (name) => getComputedStyle(root).getPropertyValue("--" + name).trim();
  const element = (tag, attributes = {}, ...children) => {
    const made = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    made.append(...children);
    return made;
  };

  // Tables: a click on a heading sorts the rows within each group; each table downloads as CSV with every digit.
  const valueOf = (row, column) => {
    const cell = row.cells[column];
    if (!cell) return null;
    if (cell.dataset.v !== undefined) return Number(cell.dataset.v);
    const words = cell.textContent.trim();
    return words === "" || words === "-" ? null : words;
  };
  const compare = (a, b) => {
    if (a === null || b === null) return (a === null) - (b === null); // empty cells last
    if (typeof a === "number" && typeof b === "number") return a - b;
    if (typeof a !== typeof b) return typeof a === "number" ? -1 : 1;
    return a.localeCompare(b, undefined, { numeric: true });
  };
  const sortBy = (table, heading, column) => {
    const down = heading.getAttribute("aria-sort") === "ascending";
    table.querySelectorAll("thead th").forEach((th) => th.removeAttribute("aria-sort"));
    heading.setAttribute("aria-sort", down ? "descending" : "ascending");
    for (const body of table.tBodies) {
      const rows = [...body.rows].filter((row) => !row.classList.contains("group"));
      const keyed = rows.map((row) => [valueOf(row, column), row]);
      keyed.sort(([a], [b]) => (a === null || b === null || !down ? compare(a, b) : -compare(a, b)));
      body.append(...keyed.map(([, row]) => row));
    }
  };
  const download = (name, text) => {
    const address = URL.createObjectURL(new Blob([text], { type: "text/csv" }));
    element("a", { href: address, download: name }).click();
    setTimeout(() => URL.revokeObjectURL(address), 1000);
  };
  for (const box of document.querySelectorAll(".tablebox")) {
    const table = box.querySelector("table");
    const headings = box.classList.contains("sorts") ? [...table.tHead.rows[0].cells] : [];
    headings.forEach((heading, column) => {
      if (!heading.textContent.trim() && column > 0) return;
      const words = heading.textContent.trim() || "name";
      const button = element("button", { type: "button", class: "sort", title: "sort by " + words });
      button.append(...heading.childNodes);
      if (!button.textContent.trim()) button.textContent = "\u2195";
      button.addEventListener("click", () => sortBy(table, heading, column));
      heading.append(button);
    });
    const source = box.querySelector("script.csv");
    const button = element("button", { type: "button", class: "csv" }, "CSV");
    button.addEventListener("click", () => download(source.dataset.name + ".csv", JSON.parse(source.textContent)));
    box.append(button);
  }

  // Theme: the system's, or the reader's choice; paper is light.
  const redraw = [];
  const themed = (name) => {
    if (name) root.dataset.theme = name;
    else delete root.dataset.theme;
    redraw.forEach((draw) => draw());
  };
  const dark = matchMedia("(prefers-color-scheme: dark)");
  dark.addEventListener("change", () => themed(root.dataset.theme));
  document.getElementById("theme").addEventListener("click", () => {
    const now = root.dataset.theme || (dark.matches ? "dark" : "light");
    themed(now === "dark" ? "light" : "dark");
  });
  let before;
  addEventListener("beforeprint", () => { before = root.dataset.theme; themed("light"); });
  addEventListener("afterprint", () => themed(before));

  // Records: measured against model, residual below; one range of time for all channels.
  const holder = document.getElementById("records-data");
  if (!holder) return;
  const data = JSON.parse(holder.textContent);
  const numbers = (text) => {
    const raw = atob(text);
    const bytes = Uint8Array.from(raw, (letter) => letter.charCodeAt(0));
    return Array.from(new Float32Array(bytes.buffer), (x) => (Number.isFinite(x) ? x : null));
  };
  const section = document.getElementById("records");
  const plotsBox = document.getElementById("plots");
  const picker = document.getElementById("record");
  const below = document.getElementById("below");
  const from = document.getElementById("from");
  const to = document.getElementById("to");
  const hidden = new Set();
  let plots = [];
  let range = null; // [from, to] in seconds; null for the whole record
  let linking = false;

  const zoom = (next) => {
    range = next;
    const time = plots[0].data[0];
    const [low, high] = range || [time[0], time[time.length - 1]];
    linking = true;
    for (const plot of plots) plot.setScale("x", { min: low, max: high });
    linking = false;
    from.value = low.toFixed(2);
    to.value = high.toFixed(2);
    section.dataset.from = from.value;
    section.dataset.to = to.value;
  };
  const linked = (plot, key) => {
    if (key !== "x" || linking || !plots.length) return;
    const time = plot.data[0];
    const { min, max } = plot.scales.x;
    const whole = min <= time[0] && max >= time[time.length - 1];
    zoom(whole ? null : [min, max]);
  };
  const axis = (extra) => ({
    stroke: () => shade("quiet"), font: "11px system-ui, sans-serif",
    grid: { stroke: () => shade("rule"), width: 0.6 }, ticks: { show: false }, ...extra,
  });
  const bandPlugin = (half) => ({ hooks: { drawClear: (plot) => {
    if (!(half > 0)) return;
    const { left, top, width, height } = plot.bbox;
    const high = Math.max(top, plot.valToPos(half, "y", true));
    const low = Math.min(top + height, plot.valToPos(-half, "y", true));
    plot.ctx.fillStyle = shade("band");
    plot.ctx.fillRect(left, high, width, low - high);
  } } });
  // Tolerance of a training simulator: a corridor about the measurement, or about zero.
  const tolerancePlugin = (half, centre) => ({ hooks: { drawClear: (plot) => {
    if (!(half > 0)) return;
    const { left, top, width, height } = plot.bbox;
    const context = plot.ctx;
    const time = plot.data[0];
    context.save();
    context.beginPath();
    context.rect(left, top, width, height);
    context.clip();
    if (!centre) { // lines, because a second shade would hide that of the gusts
      context.strokeStyle = shade("green");
      context.setLineDash([6, 4]);
      for (const side of [-1, 1]) {
        const y = plot.valToPos(side * half, "y", true);
        context.beginPath();
        context.moveTo(left, y);
        context.lineTo(left + width, y);
        context.stroke();
      }
      context.restore();
      return;
    }
    context.fillStyle = shade("tolerance");
    context.beginPath();
    const at = (k, side) => [plot.valToPos(time[k], "x", true), plot.valToPos((centre[k] || 0) + side * half, "y", true)];
    for (let k = 0; k < time.length; k += 1) context.lineTo(...at(k, 1));
    for (let k = time.length - 1; k >= 0; k -= 1) context.lineTo(...at(k, -1));
    context.fill();
    context.restore();
  } } });
  const fitted = (half, tolerance, centre) => (plot, low, high) => {
    if (low === null || high === null) return [-1, 1];
    const about = centre ? centre.filter((x) => x !== null) : [0];
    const least = (tolerance > 0 ? about : []).reduce((a, x) => Math.min(a, x - tolerance), -half || low);
    const most = (tolerance > 0 ? about : []).reduce((a, x) => Math.max(a, x + tolerance), half || high);
    const ends = [Math.min(low, least), Math.max(high, most)];
    const margin = 0.06 * (ends[1] - ends[0]) || 0.5 * Math.abs(ends[0]) || 1;
    return [ends[0] - margin, ends[1] + margin];
  };
  const plotOf = (title, height, series, values, half, last, tolerance = 0, centre = null) => {
    const readout = element("span", { class: "readout" });
    const box = element("div", { class: "plot" }, element("h3", {}, title + " ", readout));
    plotsBox.append(box);
    const shown = (x) => (x === null || x === undefined ? "-" : Number(x).toPrecision(4));
    const plot = new uPlot({
      width: plotsBox.clientWidth, height, legend: { show: false },
      scales: { x: { time: false }, y: { range: fitted(half, tolerance, centre) } },
      axes: [axis({ size: last ? 30 : 18, label: last ? "time [s]" : undefined, labelSize: 14, labelFont: "11px system-ui" }),
        axis({ size: 52, space: 16 })],
      series: [{}, ...series],
      cursor: { drag: { x: true, y: false }, points: { size: 5 },
        sync: { key: "records", scales: ["x", null], filters: { pub: (type) => type === "mousemove" || type === "mouseleave" } } },
      plugins: [tolerancePlugin(tolerance, centre), bandPlugin(half)],
      hooks: { setScale: [linked], setCursor: [(u) => {
        const at = u.cursor.idx;
        readout.textContent = at === null || at === undefined ? "" :
          `${u.data[0][at].toFixed(2)} s: ` + series.map((s, i) => (s.show === false || hidden.has(s.label) ? "" :
            `${s.label} ${shown(u.data[i + 1][at])}`)).filter(Boolean).join(", ");
      }] },
    }, values, box);
    plots.push(plot);
  };
  const lineOf = (model) => ({ label: model.name, stroke: () => shade(model.colour), width: 1.3, dash: model.dash,
    points: { show: false }, show: !hidden.has(model.name) });
  const draw = () => {
    const record = data.records[picker.selectedIndex];
    const time = numbers(record.t);
    for (const plot of plots) plot.destroy();
    plots = [];
    plotsBox.textContent = "";
    data.controls.forEach((control, i) => {
      const solid = { label: control, stroke: () => shade("ink"), width: 1.1, points: { show: false } };
      plotOf(`${control} [deg]`, 92, [solid], [time, numbers(record.controls[i])], 0, false);
    });
    data.channels.forEach((channel, i) => {
      const measured = numbers(record.measured[i]);
      const models = record.models.map((own) => numbers(own[i]));
      const points = { label: "measured", stroke: () => shade("ink"), paths: () => null,
        points: { show: true, size: 3, stroke: () => shade("grey"), fill: () => shade("grey") } };
      plotOf(channel, 150, [points, ...data.models.map(lineOf)], [time, measured, ...models], 0, false,
        data.tolerances[i], measured);
      const isLast = i === data.channels.length - 1;
      if (below.value === "pitch" && channel === data.pitch.channel) { // the integral of q from the first sample
        const [angle, ...angles] = record.pitch.map(numbers);
        plotOf("pitch change [deg]", isLast ? 126 : 104, [points, ...data.models.map(lineOf)], [time, angle, ...angles],
          0, isLast, data.pitch.tolerance, angle);
        return;
      }
      if (below.value === "innovation") {
        plotOf(`${channel.split(" ")[0]} innovation [\u03c3]`, isLast ? 126 : 104, data.models.map(lineOf),
          [time, ...record.innovations.map((own) => numbers(own[i]))], 2, isLast);
        return;
      }
      const residuals = models.map((own) => own.map((x, k) => (x === null || measured[k] === null ? null : measured[k] - x)));
      plotOf(`${channel.replace(" [", " residual [")}`, isLast ? 126 : 104, data.models.map(lineOf), [time, ...residuals],
        2 * record.floor[i], isLast, data.tolerances[i]);
    });
    document.getElementById("condition").textContent = record.words;
    section.dataset.record = record.name;
    zoom(range);
  };
  const toggles = document.getElementById("toggles");
  for (const [words, kind] of data.keys) {
    toggles.append(element("span", { class: "key" }, element("i", { class: kind }), words));
  }
  for (const model of data.models) {
    const chip = element("i");
    const button = element("button", { type: "button", "aria-pressed": "true" }, chip, model.name);
    const paint = () => { chip.style.background = shade(model.colour); };
    redraw.push(paint);
    paint();
    button.addEventListener("click", () => {
      if (!hidden.delete(model.name)) hidden.add(model.name);
      button.setAttribute("aria-pressed", String(!hidden.has(model.name)));
      for (const plot of plots) plot.series.forEach((s, k) => {
        if (s.label === model.name) plot.setSeries(k, { show: !hidden.has(model.name) });
      });
    });
    toggles.append(button);
  }
  const turn = (step) => {
    const count = data.records.length;
    picker.selectedIndex = (picker.selectedIndex + step + count) % count;
    draw();
  };
  const typed = () => {
    const ends = [Number(from.value), Number(to.value)];
    if (ends[1] > ends[0]) zoom(ends);
  };
  picker.addEventListener("change", draw);
  below.addEventListener("change", draw);
  from.addEventListener("change", typed);
  to.addEventListener("change", typed);
  document.getElementById("record-previous").addEventListener("click", () => turn(-1));
  document.getElementById("record-next").addEventListener("click", () => turn(1));
  document.getElementById("whole").addEventListener("click", () => zoom(null));
  redraw.push(() => plots.forEach((plot) => plot.redraw(false)));
  new ResizeObserver(() => plots.forEach((plot) => plot.setSize({ width: plotsBox.clientWidth, height: plot.height })))
    .observe(plotsBox);
  picker.selectedIndex = data.first;
  draw();
})();
