"use strict";
// Draws each figure anew, so that one can look closer; without scripts and in print its SVG stays.
(() => {
  const plots = JSON.parse(document.getElementById("plots").textContent);
  document.documentElement.classList.add("live");
  for (const figure of document.querySelectorAll("figure.drawn")) {
    const plot = plots[figure.dataset.plot];
    const box = figure.appendChild(document.createElement("div"));
    box.className = "plot";
    const size = () => ({ width: figure.clientWidth, height: Math.max(220, Math.min(300, figure.clientWidth * 0.6)) });
    const told = (unit) => (_, value) => (value === null || value === undefined ? "-" : `${+value.toPrecision(4)} ${unit}`);
    const bars = plot.bars ? uPlot.paths.bars({ size: [1, 100], align: 1 }) : undefined;
    const height = (_, low, high) =>
      plot.from_zero ? [Math.min(0, low), high > 0 ? high * 1.05 : 1] : [low - 2, high + 2];
    const options = {
      ...size(),
      scales: { x: { time: false }, y: { range: height } },
      axes: [
        { label: plot.x, labelSize: 20, size: 40, stroke: "#5a6472", grid: { stroke: "#eceff2" } },
        { label: plot.y, labelSize: 20, size: 55, stroke: "#5a6472", grid: { stroke: "#eceff2" } },
      ],
      series: [
        { label: plot.x, value: told("") },
        ...plot.series.map((one) => ({
          label: one.name, stroke: one.colour, width: 1.5, value: told(plot.unit), paths: bars,
          fill: plot.bars ? one.colour + "55" : undefined, points: { show: one.points === true, size: 4 }, spanGaps: false,
        })),
      ],
    };
    const drawn = new uPlot(options, [plot.at, ...plot.series.map((one) => one.values)], box);
    new ResizeObserver(() => drawn.setSize(size())).observe(figure);
  }
})();
