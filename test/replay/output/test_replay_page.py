# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The page of a replay in a real browser."""

import json
import shutil
import time

import numpy as np
import pytest
from recordings import box, drive, main, write
from sat_collision.replay.losses import UNSEEN
from sat_collision.replay.model.keyframes import Keyframes
from sat_collision.replay.model.result import (
    Contact, FootprintResult, PlanContact, Result, Unknown)
from sat_collision.replay.output.bag import write_example
from sat_collision.replay.output.page import write_page

webdriver = pytest.importorskip('selenium.webdriver')
from selenium.webdriver.common.by import By  # noqa: E402
from selenium.webdriver.common.keys import Keys  # noqa: E402

CHROMIUM = shutil.which('chromium') or shutil.which('google-chrome')
DRIVER = shutil.which('chromedriver')
TIMEOUT = 60.0
SECOND = 10**9

pytestmark = pytest.mark.skipif(not (CHROMIUM and DRIVER),
                                reason='install chromium and chromedriver')


@pytest.fixture(scope='module')
def chromium():
    """Return a headless browser."""
    options = webdriver.ChromeOptions()
    for argument in ('headless=new', 'no-sandbox', 'disable-dev-shm-usage', 'disable-gpu',
                     'window-size=1280,900', 'force-device-scale-factor=1'):
        options.add_argument(f'--{argument}')
    options.binary_location = CHROMIUM
    options.set_capability('goog:loggingPrefs', {'browser': 'ALL', 'performance': 'ALL'})
    driver = webdriver.Chrome(options, webdriver.ChromeService(DRIVER))
    yield driver
    driver.quit()


@pytest.fixture
def page(chromium):
    """Return a function that opens a page; afterwards there are no requests and no errors."""
    opened = []

    def open_page(path):
        opened.append(path.as_uri())
        chromium.get(opened[-1])
        return Page(chromium)

    yield open_page
    device(chromium, 0, 0)
    events = [json.loads(entry['message'])['message'] for entry in chromium.get_log('performance')]
    asked = {event['params']['request']['url'] for event in events
             if event['method'] == 'Network.requestWillBeSent'}
    assert {url for url in asked if not url.startswith(('data:', 'about:'))} == set(opened)
    assert chromium.get_log('browser') == []


@pytest.fixture(scope='module')
def of_warehouse(tmp_path_factory):
    """Return a page of the example."""
    path = tmp_path_factory.mktemp('page')
    write_example(path / 'warehouse')
    assert main([str(path / 'warehouse'), '--params-file',
                 str(path / 'warehouse' / 'params.yaml'), '--plot', str(path / 'page.html')],
                None) == 1
    return path / 'page.html'


@pytest.fixture
def shown(page, of_warehouse):
    """Return the open page of the example."""
    return page(of_warehouse)


class Page:
    """The contents and controls of an open page."""

    def __init__(self, chromium):
        self.chromium = chromium
        self.run = chromium.execute_script
        self.scrubber = chromium.find_element(By.ID, 'scrubber')

    def find(self, selector):
        return self.chromium.find_elements(By.CSS_SELECTOR, selector)

    def text(self, selector):
        return self.find(selector)[0].text

    def texts(self, selector):
        return [one.text for one in self.find(selector)]

    @property
    def time(self):
        return float(self.text('#clock').split()[0])

    def click(self, selector, number=0):
        """Click on an element with the mouse."""
        found = self.find(selector)[number]
        self.run('arguments[0].scrollIntoView({block: "center"})', found)
        actions = webdriver.ActionChains(self.chromium)
        # A drawing accepts a click only after a mouse move over it.
        actions.move_to_element_with_offset(found, 2, 1).pause(0.3)
        actions.move_to_element(found).pause(0.3).click().perform()

    def choose(self, view):
        next(one for one in self.find('#view option') if one.text == view).click()

    def drawn(self, colour):
        """Return the bounds in pixels of the footprint with an outline of a colour."""
        return self.run("""
            const found = [...document.querySelectorAll('#scene path.footprint')].find(one =>
                getComputedStyle(one).stroke === arguments[0]);
            const {left, right, top, bottom} = found.getBoundingClientRect();
            return [left, right, top, bottom].map(Math.round);""", colour)

    def drag(self, share):
        """Move the scrubber to a share of its range."""
        width = self.scrubber.size['width']
        self.run('arguments[0].scrollIntoView({block: "center"})', self.scrubber)
        webdriver.ActionChains(self.chromium).move_to_element_with_offset(
            self.scrubber, round((share - 0.5) * width), 0).click().perform()

    def until(self, condition):
        end = time.monotonic() + TIMEOUT
        while not condition():
            assert time.monotonic() < end
            time.sleep(0.02)


AMR, FORKLIFT, CART = 'rgb(31, 119, 180)', 'rgb(224, 130, 20)', 'rgb(123, 82, 171)'


def test_page_opens_at_the_deepest_contact(shown):
    """With the recording's name as its title, and all tables."""
    assert shown.chromium.title == shown.text('#name') == 'warehouse'
    assert shown.text('#verdict') == 'collision' and not shown.text('#index')
    assert shown.text('#clock') == '9.698 s'
    assert 'amr in contact with people/0 (0.394 m deep)' in shown.texts('#states li')
    assert [len(shown.texts(f'#{table} tbody tr'))
            for table in ('contacts', 'unknown', 'footprints', 'messages')] == [3, 2, 3, 5]
    assert 'recorded motion' in shown.text('#facts') and '1869 messages' in shown.text('#facts')


def test_scrubber_changes_the_time(shown):
    """By mouse and keyboard."""
    shown.choose('whole scene')
    shown.drag(0.1)
    early = shown.drawn(AMR)
    assert shown.time == pytest.approx(1.6, abs=0.3)
    shown.drag(0.9)
    late, before = shown.drawn(AMR), shown.time
    assert before == pytest.approx(14.4, abs=0.3)
    assert late[0] > early[1] and late[2:] == early[2:]
    shown.scrubber.send_keys(*[Keys.ARROW_LEFT] * 20)
    assert shown.time < before and shown.drawn(AMR)[0] < late[0]


def test_view_follows_a_footprint(shown):
    shown.choose('follow amr')
    places = []
    for share in (0.3, 0.6):
        shown.drag(share)
        places.append(shown.drawn(AMR))
    assert places[0] == pytest.approx(places[1], abs=1)


@pytest.mark.parametrize('number, name, clock, colour', [
    (0, 'cart', '5.998 s', CART), (2, 'forklift', '11.998 s', FORKLIFT)])
def test_click_on_a_contact_in_the_table_shows_its_deepest_moment(
        shown, number, name, clock, colour):
    """And centres the footprint."""
    shown.click('#contacts tbody tr', number)
    assert shown.text('#clock') == clock
    state, = (text for text in shown.texts('#states li') if text.startswith(name))
    assert 'in contact with warehouse' in state
    left, right, top, bottom = shown.drawn(colour)
    scene = shown.run('return at("scene").getBoundingClientRect().toJSON()')
    assert scene['left'] < left < right < scene['right']
    assert scene['top'] < top < bottom < scene['bottom']
    assert right - left > 0.2 * scene['width']
    assert shown.text('#contacts tr.chosen').startswith(name)


@pytest.mark.parametrize('number, count, normal', [(0, 2, [0, 1]), (1, 1, [1, 0]), (2, 2, [0, 1])])
def test_points_and_normal_of_a_contact_are_drawn(shown, number, count, normal):
    """On the screen y points down; at other times they are faint."""
    shown.click('#contacts tbody tr', number)
    drawn = shown.run("""
        return [...document.querySelectorAll('#scene .manifold path')].map(one => {
            const length = one.getTotalLength();
            const [from, to] = [0, length].map(way => one.getPointAtLength(way));
            return [(to.x - from.x) / length, (to.y - from.y) / length].map(Math.round);
        });""")
    assert drawn == [normal] * count
    assert len(shown.texts('#scene .manifold circle')) == count
    opacity = 'return at("scene").querySelector(".manifold").getAttribute("opacity")'
    assert shown.run(opacity) == '1'
    shown.scrubber.send_keys(*[Keys.ARROW_RIGHT] * 8)
    assert shown.run(opacity) == '0.3'


def test_click_on_a_bar_shows_the_deepest_moment(shown):
    clocks = set()
    for number in range(3):
        shown.click('#timeline rect.bar.contact', number)
        clocks.add(shown.text('#clock'))
    assert clocks == {'9.698 s', '5.998 s', '11.998 s'}


def test_click_on_the_timeline(shown):
    shown.click('#timeline svg path.zero')
    assert shown.time == pytest.approx(8.0, abs=0.3)


def test_drag_over_the_timeline_zooms_and_a_double_click_resets(shown):
    widths = []
    timeline, = shown.find('#timeline')
    for act in (lambda actions: actions,
                lambda actions: actions.move_to_element(timeline).click_and_hold()
                .move_by_offset(200, 0).release(),
                lambda actions: actions.move_to_element(timeline).double_click()):
        act(webdriver.ActionChains(shown.chromium)).perform()
        widths.append(shown.find('#timeline rect.bar.contact')[0].rect['width'])
    assert widths[1] > 1.5 * widths[0] == pytest.approx(1.5 * widths[2])


def test_scene_plays_to_its_end(shown):
    shown.drag(0.97)
    shown.click('#play')
    shown.until(lambda: shown.text('#play') == 'Play')
    assert shown.scrubber.get_attribute('value') == shown.scrubber.get_attribute('max')


def test_short_bar_is_visible_on_a_long_axis(page, tmp_path):
    main([str(write(tmp_path / 'long', drive(300.0, rate=4.0, contact=(170.0, 170.2)))),
          '--plot', str(tmp_path / 'page.html')])
    shown = page(tmp_path / 'page.html')
    bar, = shown.find('#timeline rect.bar.contact')
    assert bar.value_of_css_property('stroke-width') == '2px'
    shown.click('#contacts tbody tr')
    assert 169.0 <= shown.time < 171.0


@pytest.mark.long
def test_several_recordings_have_an_index_with_the_worst_first(page, tmp_path, capsys):
    """By verdict, then by separation; a damaged one has no drawing."""
    bags = {'clear': drive(3.0, contact=(0, 0)), 'touching': drive(3.0, contact=(1.0, 1.5)),
            'a</script>': [(topic, k / 10, points) for k in range(31) for topic, points in (
                ('/footprint', box(0)), ('/obstacles', box(0.2)), ('/obstacles', []))],
            'silent': [('/footprint', k / 10, box(0)) for k in range(31)]}
    (tmp_path / 'a<').mkdir()
    paths = [str(write(tmp_path / name, messages)) for name, messages in bags.items()]
    (tmp_path / 'damaged').mkdir()
    (tmp_path / 'damaged' / 'damaged.mcap').write_bytes(b'damaged')
    file = tmp_path / 'page.html'
    assert main([*paths, str(tmp_path / 'damaged'), '--plot', str(file), '--jobs', '2']) == 1
    capsys.readouterr()
    shown = page(file)
    assert shown.chromium.title == shown.text('#index h1') == '5 recordings: collision'
    assert shown.texts('#index tbody td:first-child') == [
        'script>', 'touching', 'damaged', 'silent', 'clear']
    assert shown.texts('#index td.verdict') == [
        'collision', 'collision', 'bad input', 'unknown', 'clear']
    for number, (name, is_drawn) in enumerate((
            ('script>', True), ('touching', True), ('damaged', False), ('silent', True),
            ('clear', True))):
        shown.click('#index tbody tr', number)
        shown.until(lambda: shown.text('#name') == name)
        assert shown.scrubber.is_displayed() is is_drawn
        remarks = [one for one in shown.texts('#remarks li') if UNSEEN not in one]
        assert bool(remarks) is (name in ('damaged', 'silent'))


def test_state_is_unknown_as_in_the_table(shown):
    for moment, words in ((0.02, 'unknown: obstacle source'), (0.25, 'unknown: obstacle source'),
                          (0.49, 'unknown: obstacle source'), (0.51, 'clear, about')):
        shown.run('location.hash = arguments[0]', f't={moment}')
        shown.until(lambda: shown.text('#clock') == f'{moment:.3f} s')
        assert all(words in state for state in shown.texts('#states li'))


def test_keyboard_and_screen_reader(shown):
    """The timeline is a slider with a value text; space plays and pauses."""
    timeline, = shown.find('#timeline')
    assert timeline.get_attribute('aria-valuetext').startswith(
        '9.698 s, amr in contact with people/0')
    timeline.send_keys(Keys.HOME)
    assert shown.text('#clock') == '0.000 s'
    timeline.send_keys(Keys.PAGE_UP, Keys.PAGE_UP)
    assert shown.text('#clock') == '1.600 s'
    assert shown.scrubber.get_attribute('aria-valuetext').startswith('1.600 s, amr clear')
    timeline.send_keys(Keys.SPACE)
    assert shown.text('#play') == 'Pause'
    shown.until(lambda: shown.time > 1.8)
    timeline.send_keys(Keys.SPACE)
    assert shown.text('#play') == 'Play'


def test_link_to_a_moment(shown, of_warehouse):
    """The address follows the time, and sets it."""
    shown.click('#contacts tbody tr', 2)
    assert shown.chromium.current_url.endswith('#t=11.998')
    shown.chromium.get('about:blank')
    shown.chromium.get(of_warehouse.as_uri() + '#t=6.5')
    assert Page(shown.chromium).text('#clock') == '6.500 s'
    shown.chromium.get(of_warehouse.as_uri())


def test_tables_are_sorted_by_a_clicked_column(shown):
    """Numbers as numbers, ascending and descending."""
    for column, wanted in ((5, ['0', '0.15', '0.3938']), (5, ['0.3938', '0.15', '0']),
                           (1, ['amr', 'cart', 'forklift'])):
        shown.click(f'#contacts th:nth-child({column}) button')
        assert shown.texts(f'#contacts td:nth-child({column})') == wanted
    shown.click('#contacts tbody tr', 1)
    assert shown.text('#clock') == '5.998 s', 'of the row that is there now'


def device(chromium, width, height, scheme='light'):
    """Emulate another device; none with a width of 0."""
    chromium.execute_cdp_cmd('Emulation.setEmulatedMedia', {'features': [
        {'name': 'prefers-color-scheme', 'value': scheme}]})
    if width:
        chromium.execute_cdp_cmd('Emulation.setDeviceMetricsOverride', {
            'width': width, 'height': height, 'deviceScaleFactor': 1, 'mobile': width < 600})
    else:
        chromium.execute_cdp_cmd('Emulation.clearDeviceMetricsOverride', {})


@pytest.fixture(scope='module')
def of_crowd(tmp_path_factory):
    """Return a page of thirteen footprints with long names, one in contact."""
    folder = tmp_path_factory.mktemp('crowd')
    names = [f'robot_with_a_long_name_{k}' for k in range(13)]
    messages = []
    for k in range(41):
        messages += [(f'/{name}', k / 10, box(1.5 * row)) for row, name in enumerate(names)]
        messages += [('/obstacles', k / 10, box(0.0, 0.9 if 10 < k < 20 else 3.0)),
                     ('/obstacles', k / 10, [])]
    topics = [argument for name in names for argument in ('--footprint', f'{name}:=/{name}')]
    assert main([str(write(folder / 'crowd', messages)), *topics, '--obstacles', '/obstacles',
                 '--plot', str(folder / 'page.html')]) == 1
    return folder / 'page.html'


@pytest.mark.parametrize('width, height', [(1280, 900), (390, 844)])
@pytest.mark.parametrize('scheme', ('light', 'dark'))
def test_page_fits_desktop_and_phone(page, of_crowd, width, height, scheme):
    """No text is cut off, the controls are small, and colours are readable."""
    shown = page(of_crowd)
    device(shown.chromium, width, height, scheme)
    shown.chromium.refresh()
    size = shown.run("""
        const style = getComputedStyle(document.body);
        const light = colour => colour.match(/[0-9]+/g).slice(0, 3).map(Number)
            .reduce((a, b) => a + b);
        const cut = [...document.querySelectorAll('h1, h2, p, li, td, button, output')]
            .filter(one => one.offsetParent && one.scrollWidth > one.clientWidth + 1 &&
                getComputedStyle(one).display !== 'inline');
        const edge = document.getElementById('timeline').getBoundingClientRect().left;
        cut.push(...[...document.querySelectorAll('#timeline text.name')].filter(
            one => one.getBoundingClientRect().left < edge));
        return [document.documentElement.scrollWidth, innerWidth,
            document.getElementById('control').offsetHeight,
            light(style.backgroundColor), light(style.color), cut.length];""")
    assert size[0] <= size[1] == width and size[5] == 0
    assert size[2] < 0.1 * height
    assert (size[3] > size[4] + 300) is (scheme == 'light')
    assert (size[4] > size[3] + 300) is (scheme == 'dark')
    assert len({*shown.run('return recording.footprints.map(one => one.colour)')}) == 13


# For each text that is shown: its contrast with what is behind it, and the text.
CONTRASTS = """
    const numbers = colour => colour.match(/[0-9.]+/g).map(Number);
    const light = colour => {
        const [r, g, b] = numbers(colour).map(
            one => one <= 10 ? one / 3294 : ((one / 255 + 0.055) / 1.055) ** 2.4);
        return 0.2126 * r + 0.7152 * g + 0.0722 * b;
    };
    const behind = one => {
        if (one.classList.contains('inside')) {
            return getComputedStyle(one.previousElementSibling).fill;
        }
        const own = getComputedStyle(one).backgroundColor;
        return (numbers(own)[3] ?? 1) > 0 ? own : behind(one.parentElement);
    };
    const found = [], texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
    while (texts.nextNode()) {
        const one = texts.currentNode.parentElement, style = getComputedStyle(one);
        if (!texts.currentNode.textContent.trim() || !one.getClientRects().length) continue;
        const own = one.namespaceURI === SVG ? style.fill : style.color;
        const lights = [own, behind(one)].map(light);
        found.push([(Math.max(...lights) + 0.05) / (Math.min(...lights) + 0.05),
            texts.currentNode.textContent]);
    }
    return found;"""


def result_of(seconds, *names, **more):
    """Return the result of a recording of some seconds."""
    return Result('bag', origin=0, start=0, end=seconds * SECOND, footprints=[
        FootprintResult(name, '/a', True) for name in names], **more)


@pytest.mark.parametrize('scheme', ('light', 'dark'))
def test_texts_have_contrast(page, tmp_path, scheme):
    """Of 4.5 at least: in all colours of footprints, in bars, and of all verdicts."""
    names = [f'robot{k}' for k in range(8)]
    result = result_of(
        4, *names, keyframes=Keyframes([0, 4 * SECOND]),
        unknown=[Unknown('robot0', 0, 3 * SECOND, ('lost',))],
        undetermined=[Unknown('robot2', 0, SECOND, ('a gap',))],
        contacts=[Contact('robot1', 'shelf/0', SECOND, 3 * SECOND, 0.1, SECOND, 0.0, 0.0)])
    write_page([result], tmp_path / 'page.html')
    shown = page(tmp_path / 'page.html')
    device(shown.chromium, 1280, 900, scheme)
    for verdict in ('collision', 'clear', 'unknown', 'bad-input'):
        shown.run(
            "at('verdict').className = arguments[0]; go(arguments[1])", verdict, 2.0)
        found = shown.run(CONTRASTS)
        assert {'unknown', 'shelf/0', *names} <= {text.strip() for _, text in found}
        assert [one for one in found if one[0] < 4.5] == []
    assert shown.run("""
        return [...document.querySelectorAll('#timeline .bar title')].map(
            one => one.textContent);""") == [
        'unknown from 0.000 to 3.000 s', 'robot1 and shelf/0, 0.1 m deep',
        'undetermined from 0.000 to 1.000 s']


def test_unknown_times_of_one_cause_are_one_row(page, tmp_path):
    """Of several footprints, and of intervals that follow on each other."""
    unknown = [('one', 0, 1, 'no map', 'no people'), ('one', 1, 3, 'no map'),
               ('one', 5, 6, 'no map'), ('two', 0, 1, 'no map', 'no people'),
               ('two', 1, 3, 'no map'), ('two', 5, 6, 'no map'), ('two', 7, 8, 'no map')]
    write_page([result_of(9, 'one', 'two', unknown=[
        Unknown(name, first * SECOND, last * SECOND, reasons)
        for name, first, last, *reasons in unknown])], tmp_path / 'page.html')
    shown = page(tmp_path / 'page.html')
    assert shown.texts('#unknown tbody tr') == [
        'one, two 0.000 1.000 no people', 'one, two 0.000 3.000 no map',
        'one, two 5.000 1.000 no map', 'two 7.000 1.000 no map']


@pytest.fixture(scope='module')
def with_times_to_collision(of_warehouse):
    """Return a page of the example with times to collision."""
    path, bag = of_warehouse.with_name('times.html'), of_warehouse.parent / 'warehouse'
    main([str(bag), '--params-file', str(bag / 'params.yaml'), '--min-ttc', '0.5',
          '--plot', str(path)], None)
    return path


@pytest.mark.parametrize('width', (
    1280, *(pytest.param(width, marks=pytest.mark.long) for width in (390, 100))))
def test_time_to_collision_has_a_title_and_a_unit(page, with_times_to_collision, width):
    """Above its panel, which has an axis; no width is negative, even on the narrowest page."""
    shown = page(with_times_to_collision)
    device(shown.chromium, width, 844)
    shown.chromium.refresh()
    heights = dict(shown.run("""
        return [...document.querySelectorAll('#timeline text')].map(
            one => [one.textContent, Number(one.getAttribute('y'))]);"""))
    assert 80 < heights['0 s'] - heights['Time to collision'] < 120
    assert heights['Time to collision'] < heights['2 s'] < heights['0 s']
    assert 'found at a sample: at the stamp of a message' in shown.text('#tables')


def test_plan_in_contact_is_drawn_while_it_counts(page, tmp_path):
    """Its way, and the outline where it meets the obstacle; a click in the table shows it."""
    keyframes = Keyframes([0, 4 * SECOND])
    keyframes.add(True).show(0, 2, 'robot', np.array(box(0.0)))
    result = result_of(4, 'robot', keyframes=keyframes, plan_contacts=[PlanContact(
        'robot', 'shelf/0', SECOND, 2 * SECOND, 0.9, 9.0, [[0.5, 0.5], [9.5, 0.5]], box(9.0))])
    result.footprints[0].plans = 2
    write_page([result], tmp_path / 'page.html')
    shown = page(tmp_path / 'page.html')
    plans = 'return document.querySelectorAll("#scene path.plan").length'
    assert shown.text('#clock') == '0.000 s' and shown.run(plans) == 0
    shown.click('[id="plans in contact"] tbody tr')
    assert shown.text('#clock') == '1.000 s' and shown.run(plans) == 2
    assert shown.run(
        'return getComputedStyle(document.querySelector("#scene .plan.contact")).stroke'
    ) == 'rgb(214, 39, 40)'
    shown.drag(0.9)
    assert shown.run(plans) == 0


def with_long_curves(count, rng, **more):
    """Return a result of five minutes with footprints that have as many samples as are kept."""
    result = result_of(300, *(f'robot{k}' for k in range(count)), **more)
    for footprint in result.footprints:
        footprint.separation = [(int(t), float(v)) for t, v in zip(
            np.linspace(0, 300e9, 4096), rng.random(4096))]
    return result


@pytest.mark.long
def test_page_of_many_recordings_has_at_most_eight_megabytes(tmp_path):
    """With long curves, and plans of many places."""
    rng = np.random.default_rng(1)
    result = with_long_curves(3, rng, plan_contacts=[PlanContact(
        'robot0', 'shelf/0', SECOND * k, SECOND * (k + 1), 0.9, 9.0, rng.random((200, 2)).tolist(),
        box(9.0)) for k in range(200)])
    for footprint in result.footprints:
        footprint.plans = 200
    write_page(30 * [result], tmp_path / 'page.html')
    assert 3_000_000 < (tmp_path / 'page.html').stat().st_size <= 8_000_000


@pytest.mark.long
def test_tables_of_many_recordings_say_how_much_more_there_is(tmp_path):
    """Of twelve recordings, each with more contacts and unknown times than its share can hold."""
    result = result_of(
        2000, 'robot', problems=[f'{20 * "words "}{k}' for k in range(150)],
        contacts=[Contact('robot', f'shelves/{k}', SECOND * k, SECOND * k + 10**8, 0.1, SECOND * k)
                  for k in range(300)],
        unknown=[Unknown('robot', SECOND * k, SECOND * k + 10**8, [f'{500 * "words "}{k}'])
                 for k in range(2000)],
        plan_contacts=[PlanContact('robot', 'shelf/0', SECOND * k, SECOND * (k + 1), 0.9, 9.0)
                       for k in range(250)])
    write_page(12 * [result], tmp_path / 'page.html')
    text = (tmp_path / 'page.html').read_text()
    assert 3_000_000 < len(text) <= 8_000_000
    shown = json.loads(text.partition('type="application/json">')[2].partition('</script>')[0])
    for one in shown['recordings']:
        tables = {table['title']: table for table in one['tables']}
        for title, which, count in (('Contacts', 'deepest', 300), ('Unknown', 'longest', 2000),
                                    ('Plans in contact', 'first', 250)):
            rows = len(tables[title]['rows'])
            assert 0 < rows < 200 and tables[title]['note'].startswith(
                f'the {which} {rows}; {count - rows} more are in what --json writes')
        assert len(one['contacts']) == len(tables['Contacts']['rows'])
        problems = len(one['problems']) - 1
        assert one['problems'][-1] == (
            f'the first {problems}; {150 - problems} more are in what --json writes')
        assert sorted(bar['contact'] for lane in one['lanes'] for bar in lane['bars']
                      if bar['text'] != 'unknown') == [*range(len(one['contacts']))]


@pytest.mark.long
@pytest.mark.parametrize('bodies, moments', [(200, 440), (1500, 200)])
def test_page_has_at_most_eight_megabytes(page, tmp_path, bodies, moments):
    """With many obstacles, long curves and many unknown intervals."""
    rng = np.random.default_rng(1)
    keyframes = Keyframes(np.linspace(0, 300e9, moments).astype(int).tolist())
    result = with_long_curves(
        40, rng, keyframes=keyframes,
        unknown=[Unknown(f'robot{k % 40}', 10**6 * k, 10**6 * k + 5 * 10**5, ['silent'])
                 for k in range(100_000)],
        contacts=[Contact('robot0', 'obstacle/1', SECOND * k, SECOND * k + 10**8, 0.1, SECOND * k)
                  for k in range(290)])
    for number in range(bodies + 1):
        body = keyframes.add(number == 0)
        places = 100 * rng.random((moments, 1, 2)) + rng.random((moments, 4, 2))
        for k in range(moments):
            body.show(k, k + 1, f'robot{number}' if number == 0 else f'obstacle/{number}',
                      places[k])
    write_page([result], tmp_path / 'page.html')
    assert (tmp_path / 'page.html').stat().st_size <= 8_000_000
    shown = page(tmp_path / 'page.html')
    assert shown.text('#verdict') == 'collision'
    assert shown.run('return recording.times.length') >= 12
