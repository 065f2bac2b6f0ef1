// Time from left to right: curves of separations and of times to collision, and rows of bars for
// each footprint.
const timeline = at('timeline');
const ROW = 22, MARGIN = {left: 108, right: 14, top: 8, bottom: 40}, GAP = 14, AHEAD = 90, TITLE = 18;
let shownTimes = [0, 1], cursor = null;

const SVG = 'http://www.w3.org/2000/svg';

function svg(kind, attributes = {}, text = '') {
  const made = document.createElementNS(SVG, kind);
  Object.entries(attributes).forEach(([key, value]) => made.setAttribute(key, value));
  if (text) made.textContent = text;
  return made;
}

// About `count` round numbers between two others, and how many decimals they have.
function ticks(low, high, count) {
  const rough = (high - low) / Math.max(count, 1) || 1;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find(factor => factor * power >= rough);
  const found = [];
  for (let k = Math.ceil(low / step); k * step <= high; k++) found.push(k * step);
  return {found, decimals: Math.max(0, -Math.floor(Math.log10(step) + 1e-9))};
}

function timeScale() {
  const width = timeline.clientWidth - MARGIN.left - MARGIN.right;
  const [low, high] = shownTimes;
  return {
    x: time => MARGIN.left + width * (time - low) / (high - low),
    time: x => low + (x - MARGIN.left) * (high - low) / width};
}

function showAllTimes() {
  shownTimes = [recording.start, Math.max(recording.end, recording.start + 1e-6)];
  drawTimeline();
}

function drawTimeline() {
  const {lanes, footprints, contacts} = recording;
  const count = lanes.length ? lanes[lanes.length - 1].end : 1;
  const ahead = footprints.flatMap(one => one.ahead.map(([, value]) => value));
  const below = ahead.length ? AHEAD + TITLE + GAP : 0;
  timeline.style.minHeight = `${MARGIN.top + 230 + below + GAP + ROW * count + MARGIN.bottom}px`;
  const {clientWidth: width, clientHeight: height} = timeline;
  const bottom = height - MARGIN.bottom, top = bottom - ROW * count;
  const {x} = timeScale();
  const values = footprints.flatMap(one => one.values).filter(one => one !== null)
    .concat(contacts.map(one => one.value), 0);
  const low = Math.min(...values.slice(-contacts.length - 1), least(values));
  const high = most(values) || 1;
  const floor = top - GAP - below;
  const y = value => floor - (floor - MARGIN.top) * (value - low) / ((high - low) || 1);
  const longest = most(ahead) || 1;
  const ySeconds = value => top - GAP - AHEAD * value / longest;
  const drawn = svg('svg', {'aria-hidden': 'true'});
  const clip = svg('clipPath', {id: 'within'});
  clip.append(svg('rect', {x: MARGIN.left, y: 0,
    width: Math.max(width - MARGIN.left - MARGIN.right, 0), height}));
  const inner = svg('g', {'clip-path': 'url(#within)'});
  drawn.append(clip);
  const across = ticks(...shownTimes, width / 110), up = ticks(low, high, 5);
  for (const time of across.found) {
    drawn.append(svg('path', {class: 'grid', d: `M${x(time)},${MARGIN.top}V${bottom}`}),
      svg('text', {x: x(time), y: bottom + 15, 'text-anchor': 'middle'},
        time.toFixed(across.decimals)));
  }
  const level = (height, text) => drawn.append(
    svg('path', {class: 'grid', d: `M${MARGIN.left},${height}H${width - MARGIN.right}`}),
    svg('text', {x: MARGIN.left - 6, y: height + 4, 'text-anchor': 'end'}, text));
  up.found.forEach(value => level(y(value), value.toFixed(up.decimals) + ' m'));
  if (below) {
    const {found, decimals} = ticks(0, longest, 2);
    found.forEach(value => level(ySeconds(value), value.toFixed(decimals) + ' s'));
    drawn.append(svg('text', {class: 'name', x: MARGIN.left, y: top - GAP - AHEAD - 6},
      'Time to collision'));
  }
  drawn.append(svg('text', {x: (MARGIN.left + width - MARGIN.right) / 2, y: height - 6,
    'text-anchor': 'middle'}, 'time since the recording begins [s]'));
  const bars = lanes.flatMap(lane => lane.bars);
  for (const bar of bars) {
    inner.append(svg('rect', {class: bar.contact === null ? 'shade' : 'shade contact',
      x: x(bar.first), width: Math.max(x(bar.last) - x(bar.first), 0), y: MARGIN.top,
      height: top - GAP - MARGIN.top}));
  }
  inner.append(svg('path', {class: 'zero', d: `M${MARGIN.left},${y(0)}H${width}`}));
  for (const {colour, times, values: own, ahead} of footprints) {
    inner.append(svg('path', {class: 'curve', stroke: colour,
      d: path(times.map((time, k) => [time, own[k]]), x, y, recording.asLive)}));
    inner.append(svg('path', {class: 'curve ahead', stroke: colour, d: path(ahead, x, ySeconds)}));
  }
  lanes.forEach((lane, k) => {
    const middle = top + ROW * (lane.first + lane.end) / 2;
    const short = lane.name.length > 10 ? `${lane.name.slice(0, 3)}…${lane.name.slice(-6)}` : lane.name;
    const name = svg('text', {class: 'name', x: MARGIN.left - 17, y: middle + 4,
      'text-anchor': 'end'}, short);
    drawn.append(svg('rect', {class: 'own', x: MARGIN.left - 13, y: middle - 4, width: 8, height: 8,
      fill: footprints[k].colour}));
    name.append(svg('title', {}, lane.name));
    drawn.append(name);
    if (k) drawn.append(svg('path', {class: 'grid', d: `M0,${top + ROW * lane.first}H${width}`}));
  });
  bars.forEach(bar => inner.append(...drawBar(bar, bars, top)));
  contacts.forEach((one, k) => {
    const dot = svg('circle', {class: 'deepest', cx: x(one.deepest), cy: y(one.value), r: 3.5,
      'data-contact': k});
    dot.append(svg('title', {}, title(one)));
    inner.append(dot);
  });
  cursor = svg('path', {class: 'cursor'});
  inner.append(cursor);
  drawn.append(inner);
  timeline.replaceChildren(drawn);
  moveCursor();
}

// A curve of [time, value], interrupted where there is no value.
function path(samples, x, y, inSteps = false) {
  return samples.map(([time, value], k) => {
    if (value === null) return '';
    const [right, up] = [x(time).toFixed(1), y(value).toFixed(1)];
    if (!k || samples[k - 1][1] === null) return `M${right},${up}`;
    return inSteps ? `H${right}V${up}` : `L${right},${up}`;
  }).join('');
}

const least = values => values.reduce((a, b) => Math.min(a, b), Infinity);
const most = values => values.reduce((a, b) => Math.max(a, b), -Infinity);

function drawBar(bar, bars, top) {
  const {x} = timeScale();
  const [first, last] = [x(bar.first), x(bar.last)];
  const isContact = bar.contact !== null;
  const middle = top + ROW * (bar.row + 0.5);
  const box = svg('rect', {class: isContact ? 'bar contact' : 'bar', x: first,
    width: Math.max(last - first, 0.1), y: middle - 7, height: 14,
    ...isContact ? {'data-contact': bar.contact} : {'data-time': bar.first}});
  box.append(svg('title', {}, isContact ? title(recording.contacts[bar.contact]) :
    `${bar.text} from ${bar.first.toFixed(3)} to ${bar.last.toFixed(3)} s`));
  const needed = 6.2 * bar.text.length + 8;
  const next = Math.min(timeline.clientWidth - MARGIN.right, ...bars.filter(other =>
    other.row === bar.row && other.first > bar.first).map(other => x(other.first)));
  if (needed <= last - first) {
    return [box, svg('text', {class: isContact ? 'inside' : 'inside gap', x: (first + last) / 2, y: middle + 4,
      'text-anchor': 'middle'}, bar.text)];
  }
  return needed <= next - last ?
    [box, svg('text', {x: last + 5, y: middle + 4}, bar.text)] : [box];
}

function title(contact) {
  return `${recording.footprints[contact.footprint].name} and ${contact.obstacle}, ` +
    contact.words;
}

function moveCursor() {
  const x = timeScale().x(now);
  if (cursor) cursor.setAttribute('d', `M${x},0V${timeline.clientHeight - MARGIN.bottom + 4}`);
}

// A click goes to a time, a drag shows a part, a double click all.
let pressed = null;
timeline.onpointerdown = event => { pressed = event.offsetX; };
timeline.onpointerup = event => {
  const begun = pressed;
  pressed = null;
  if (begun === null) return;
  const {time} = timeScale();
  if (Math.abs(event.offsetX - begun) > 12 && event.pointerType === 'mouse') {
    shownTimes = [time(begun), time(event.offsetX)].sort((a, b) => a - b)
      .map(one => Math.min(Math.max(one, recording.start), recording.end));
    if (shownTimes[1] - shownTimes[0] < 1e-6) showAllTimes(); else drawTimeline();
    return;
  }
  const {contact, time: first} = event.target.dataset;
  stop();
  if (contact !== undefined) jump(Number(contact));
  else go(first === undefined ? time(event.offsetX) : Number(first));
};
timeline.ondblclick = showAllTimes;
