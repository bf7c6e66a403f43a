"use strict";
/* Figures of the library in the page's colors, and what is drawn into them: curves, their bands, stretches of time. */
Bokeh.set_log_level("warn");
vsacli.figures = (() => {
  const { data, array, color, curveColor } = vsacli;
  /* Dashes of a curve, and the border that stands for them in a legend. */
  const DASHES = [["solid", "solid"], ["dashed", "dashed"], ["dotdash", "double"], ["dotted", "dotted"]];

  /* Joints have colors; what is beyond those, other files and other roles have other dashes. */
  function dash(series) {
    const roles = { commanded: 1, measured: 3 };
    return DASHES[(roles[series.role] || series.file + Math.floor(series.color / vsacli.COLORS)) % DASHES.length];
  }

  function absolute(times) {
    return Float64Array.from(times, (time) => time + data.start);
  }

  /* The stretches of a kind at some joints of any file, those that overlap as one. */
  function stretches(kind, joints) {
    const every = data.files.flatMap((file) => (kind === "unreliable" ? file.unreliable
      : (file.troubles[kind] || []).filter((_, joint) => joints.has(joint)).flat()));
    const merged = [];
    for (const [start, end] of every.sort((one, other) => one[0] - other[0])) {
      const last = merged.at(-1);
      if (last && start <= last[1]) last[1] = Math.max(last[1], end); else merged.push([start, end]);
    }
    return merged;
  }

  function shade(figure, kind, joints, look) {
    const spans = stretches(kind, joints);
    if (spans.length) {
      const [x0, x1] = [0, 1].map((end) => spans.map((span) => span[end] + data.start));
      figure.vstrip({ x0, x1, fill_color: color(kind), line_color: color(kind), line_alpha: look.fill_alpha,
                      level: "underlay", ...look });
    }
  }

  /* Runs of points between gaps, as index pairs; single points are what a line would not show. */
  function runs(values) {
    const found = [];
    let start = -1;
    for (let index = 0; index <= values.length; index += 1) {
      const there = index < values.length && !Number.isNaN(values[index]);
      if (there && start < 0) start = index;
      if (!there && start >= 0) { found.push([start, index]); start = -1; }
    }
    return found;
  }

  function addBand(figure, series, x, fill) {
    const [lower, upper] = series.band.map(array);
    const summed = lower.map((value, index) => value + upper[index]);
    return runs(summed).filter(([start, end]) => end - start > 1).map(([start, end]) => {
      const [part, y1, y2] = [x, lower, upper].map((each) => each.slice(start, end));
      const source = new Bokeh.ColumnDataSource({ data: { x: part, y1, y2 } });
      const look = { fill_color: fill, fill_alpha: 0.3, level: "underlay" };
      return figure.varea({ field: "x" }, { field: "y1" }, { field: "y2" }, { source, ...look });
    });
  }

  function addSeries(figure, series, bandColor) {
    const x = absolute(array(series.time)), y = array(series.values);
    const look = { line_color: curveColor(series.color), line_width: series.role === "measured" ? 1 : 1.7,
                   line_dash: dash(series)[0] };
    const source = new Bokeh.ColumnDataSource({ data: { x, y } });
    const drawn = [figure.line({ field: "x" }, { field: "y" }, { source, ...look })];
    const alone = runs(y).filter(([start, end]) => end - start === 1).map(([start]) => start);
    if (alone.length) {
      drawn.push(figure.scatter(alone.map((at) => x[at]), alone.map((at) => y[at]),
                                { size: 3, line_color: look.line_color, fill_color: look.line_color }));
    }
    if (series.band) drawn.push(...addBand(figure, series, x, bandColor || look.line_color));
    return { series, drawn };
  }

  function paint(figure) {
    for (const axis of [...figure.xaxes, ...figure.yaxes]) {
      axis.setv({ axis_line_color: color("line"), major_tick_line_color: color("line"), minor_tick_line_color: null,
                  major_label_text_color: color("soft"), axis_label_text_color: color("soft"),
                  axis_label_text_font_style: "normal", axis_label_text_font_size: "12px" });
    }
    for (const grid of [...figure.xgrids, ...figure.ygrids]) grid.grid_line_color = color("grid");
    figure.setv({ background_fill_color: color("card"), border_fill_color: color("card"), outline_line_color: null });
  }

  /* A figure in the page's colors, its labels taken literally. */
  function newFigure(attributes, labels) {
    const figure = Bokeh.Plotting.figure({ sizing_mode: "stretch_both", tools: [], min_border_right: 12,
                                           lod_threshold: null, ...attributes });
    figure.toolbar.autohide = true;
    figure.toolbar.logo = null;
    figure.xaxes[0].axis_label = new Bokeh.PlainText({ text: labels[0] });
    figure.yaxes[0].axis_label = new Bokeh.PlainText({ text: labels[1] });
    paint(figure);
    return figure;
  }

  function addTools(figure) {
    const tools = [new Bokeh.BoxZoomTool({ dimensions: "auto" }), new Bokeh.PanTool(),
                   new Bokeh.WheelZoomTool({ modifiers: { ctrl: true } }), new Bokeh.SaveTool()];
    figure.toolbar.setv({ tools, active_drag: tools[0], active_scroll: tools[2] });
  }

  return { DASHES, dash, addSeries, shade, newFigure, addTools };
})();
