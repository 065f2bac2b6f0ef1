// Time from left to right: curves of separations, and a lane of bands for each footprint.

function drawTimeline() {
  const {lanes, footprints, contacts, start, end} = recording;
  const rows = lanes.length ? lanes[lanes.length - 1].end : 1;
  const height = Math.max(timeline.clientHeight, 330 + ROW * rows);
  const share = ROW * rows / (height - 60);
  const short = name => name.length > 14 ? `${name.slice(0, 6)}…${name.slice(-7)}` : name;
  const curves = footprints.map(({name, colour, times, values}) => ({
    x: times, y: values, name, mode: 'lines', connectgaps: false,
    line: {color: colour, width: 1.6, shape: recording.asLive ? 'hv' : 'linear'},
    hovertemplate: '%{x:.3f} s: %{y:.3f} m'}));
  const deepest = {
    x: contacts.map(one => recording.times[one.deepest]), y: contacts.map(one => one.value),
    customdata: contacts.map((_, k) => k), text: contacts.map(title), mode: 'markers',
    marker: {color: CONTACT, size: 7}, hovertemplate: '%{text}<extra></extra>'};
  const all = lanes.flatMap(lane => lane.bands);
  const bars = [true, false].map(isContact => {
    const bands = all.filter(band => (band.contact !== null) === isContact);
    return {type: 'bar', orientation: 'h', yaxis: 'y2', width: 0.74, name: '',
      base: bands.map(band => band.first), x: bands.map(band => band.last - band.first),
      y: bands.map(band => band.row), customdata: bands.map(band => band.contact),
      text: bands.map(band => band.text), textposition: bands.map(band => place(band, all)),
      insidetextanchor: 'middle', textangle: 0, constraintext: 'none', cliponaxis: false,
      insidetextfont: {color: 'white', size: 11}, outsidetextfont: {color: INK, size: 11},
      hovertext: bands.map(band => isContact ? title(contacts[band.contact]) :
        `unknown from ${band.first.toFixed(3)} to ${band.last.toFixed(3)} s`),
      hoverinfo: 'text',
      // However short, a band is as wide as its outline.
      marker: {color: isContact ? CONTACT : UNKNOWN,
        line: {color: isContact ? CONTACT : UNKNOWN, width: 2}}};
  });
  const shades = all.map(band => ({
    type: 'rect', layer: 'below', xref: 'x', yref: 'y domain', x0: band.first, x1: band.last,
    y0: 0, y1: 1, line: {width: 0}, opacity: 0.1,
    fillcolor: band.contact === null ? UNKNOWN : CONTACT}));
  const cursor = {type: 'line', xref: 'x', yref: 'paper', x0: start, x1: start, y0: 0, y1: 1,
    line: {color: INK, width: 1.5}};
  Plotly.react(timeline, [...curves, ...bars, deepest], {...BASE, height,
    margin: {l: LEFT, r: RIGHT, t: 8, b: 44}, hovermode: 'closest', barmode: 'overlay', dragmode: 'zoom',
    hoverdistance: 40, shapes: [cursor, ...shades],
    xaxis: {...AXIS, range: [start, Math.max(end, start + 1e-9)], anchor: 'y2',
      title: {text: 'time since the recording begins [s]', standoff: 6}},
    yaxis: {...AXIS, domain: [share + 0.04, 1], title: {text: 'separation [m]', standoff: 8},
      zeroline: true, zerolinecolor: INK, zerolinewidth: 1, fixedrange: true},
    yaxis2: {domain: [0, share], range: [rows - 0.5, -0.5], fixedrange: true, zeroline: false,
      showgrid: false, ticklabelstandoff: 6, tickvals: lanes.map(lane => (lane.first + lane.end - 1) / 2),
      ticktext: lanes.map((lane, k) =>
        `<b><span style="color:${footprints[k].colour}">${short(lane.name)}</span></b>`)}},
  CONFIG);
}

// Where the words of a band fit: inside, to its right, or nowhere.
function place(band, all) {
  const {start, end} = recording;
  const scale = (timeline.clientWidth - LEFT - RIGHT) / Math.max(end - start, 1e-9);
  const pen = document.createElement('canvas').getContext('2d');
  pen.font = '11px system-ui, sans-serif';
  const needed = (pen.measureText(band.text).width + 8) / scale;
  if (needed <= band.last - band.first) return 'inside';
  const next = Math.min(end, ...all.filter(other => other.row === band.row &&
    other.first > band.first).map(other => other.first));
  return needed <= next - band.last ? 'outside' : 'none';
}

function title(contact) {
  return `${recording.footprints[contact.footprint].name} and ${contact.obstacle}, ` +
    contact.words;
}
