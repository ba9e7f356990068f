"use strict";
(() => {
  const page = JSON.parse(document.getElementById("figure-data").textContent);
  const places = [];
  for (const figure of page.figures) {
    const place = document.getElementById(figure.id);
    const data = figure.x ? figure.data.map((trace) => ({ x: figure.x, ...trace })) : figure.data;
    Plotly.newPlot(place, data, figure.layout, page.config);
    places.push(place);
  }
  // A browser lays the page out anew for paper, but tells no figure: A4 less the margins is 688 px wide.
  window.addEventListener("beforeprint", () => {
    for (const place of places) Plotly.relayout(place, { autosize: false, width: 688 });
  });
  window.addEventListener("afterprint", () => {
    for (const place of places) Plotly.relayout(place, { autosize: true, width: null });
  });
  document.documentElement.dataset.figuresDrawn = String(places.length);
})();
