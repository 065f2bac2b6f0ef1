// What a hand on the page does; then the first recording is shown.
Plotly.newPlot(timeline, [], {}, CONFIG);
Plotly.newPlot(scene, [], {}, CONFIG);
timeline.on('plotly_click', ({points: [point]}) => {
  if (typeof point.customdata === 'number') jump(point.customdata);
  else { stop(); goTo(point.base === undefined ? point.x : point.base); }
});
scrubber.oninput = () => { stop(); goTo(Number(scrubber.value)); };
scrubber.onkeydown = event => {
  const step = {ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -20,
    PageUp: 20}[event.key];
  if (step) { event.preventDefault(); stop(); go(number + step); }
};
at('play').onclick = play;
view.onchange = () => {
  const body = view.value === '' ? null : footprintBody(Number(view.value));
  const span = body && spanAt(body, number);
  const middle = span && bounds(span[4]);
  go(number, span ? ranges(middle.x, middle.y, 1.6 * middle.size) : lookAtAll());
};
if (data.index) {
  at('index').hidden = false;
  at('index').querySelector('.wide').append(table(data.index.head, data.index.rows,
    k => { location.hash = String(k + 1); }));
}
const named = () => Math.min(Math.max(Number(location.hash.slice(1)) || 1, 1),
  data.recordings.length) - 1;
window.onhashchange = () => show(named());
show(named());
