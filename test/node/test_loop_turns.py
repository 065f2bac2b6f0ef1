# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The turns of the loop: when it receives which messages, ticks and rests."""

from contextlib import contextmanager
import itertools
import math
import threading
import time
from types import SimpleNamespace

from geometry_msgs.msg import Point32, Polygon, PolygonStamped
from harness import streaming
import pytest
from rcl_interfaces.srv import ListParameters
import rclpy
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import QoSProfile
from sat_collision.node import loop


class Recorder:
    """
    Receives for a Loop and records the order; each message may take some time.

    Ticks are due twenty times per second; `are_put_off` delays them by ten seconds after a
    message, and after `often` of them the next is due in 30 s. `meets` is called with the name
    of what was received.
    """

    def __init__(self, seconds=0.0, are_put_off=False, often=math.inf, meets=id):
        self.seconds = seconds
        self.are_put_off = are_put_off
        self.often = often
        self.meets = meets
        self.names = []
        self.batches = []
        self.ticks = 0
        self.parts = 0

    def receive(self, name, messages, now, number, arrived):
        for _ in messages:
            time.sleep(self.seconds)
            self.names.append(name)
        self.meets(name)

    def begin_stream(self, name):
        self.names.append('begin')

    def advance(self, now):
        self.names.append('advance')

    def end_batch(self, messages, seconds):
        self.batches.append(messages)

    def go_on(self, now):
        self.parts and self.names.append('part')
        self.parts = max(self.parts - 1, 0)
        return self.parts > 0

    def tick(self, now):
        self.ticks += 1
        self.names.append('tick')
        self.ticked = time.monotonic()

    def due(self, now, steady):
        is_put_off = self.are_put_off and self.names[-1] != 'tick'
        return self.ticked + (
            30.0 if self.ticks > self.often else 10.0 if is_put_off else 0.05)

    def note_event(self, name, event):
        return False

    def present(self, steady):
        return time.time_ns()

    @property
    def between_ticks(self):
        # On a busy machine a turn may take so long that time passes within it.
        return [name for name in self.names if name not in ('tick', 'advance')]


@pytest.fixture
def looped(peer):
    """
    Return a context that has a Loop on 'flood' and 'other', which ends rests.

    `looped.until` runs one until a condition holds.
    """
    node = rclpy.create_node('receiver', context=peer.context)

    def subscribed(name):
        return loop.Input(name, node.create_subscription(
            PolygonStamped, name, id, QoSProfile(depth=2000), raw=True), ends_rest=name != 'flood')
    inputs = [subscribed(name) for name in ('other', 'flood')]

    @contextmanager
    def looped(receiver, delay=0.0, further=()):
        yield loop.Loop(node, [*map(subscribed, further), *inputs], receiver, lambda: delay)

    def until(receiver, condition, **options):
        with looped(receiver, **options) as one:
            one.run(condition)

    looped.node = node
    looped.until = until
    yield looped
    node.destroy_node()


def publish(publisher, count, vertices=0):
    """Publish some messages of a topic and wait until they are queued."""
    for _ in range(count):
        publisher.publish(PolygonStamped(polygon=Polygon(points=vertices * [Point32()])))
    assert publisher.wait_for_all_acked(Duration(seconds=60))


def arrive(peer, **counts):
    """Send some messages on each topic and wait until they are queued."""
    for topic, count in counts.items():
        publish(peer.publisher(topic, qos=QoSProfile(depth=2000)), count)


def test_other_topics_get_their_turn_during_a_flood(peer, looped):
    """Half a second of work is queued on one topic; the other's message and ticks come between."""
    receiver = Recorder(0.001)
    arrive(peer, flood=500, other=1)
    backlogs = []
    with looped(receiver) as one:
        one.run(lambda: backlogs.append(dict(one.backlogs)) or (
            receiver.names.count('flood') == 500 and not one.backlogs))
    assert receiver.names.index('other') < 50
    assert receiver.names[:-1].count('tick') > 3
    assert max(receiver.batches) < 50
    assert {*itertools.chain(*backlogs)} == {'flood'} and not backlogs[-1]
    assert all(backlog['flood'].seconds > 0.0 for backlog in backlogs if backlog)


def test_topic_that_was_behind_before_another_subscription_came_is_no_longer(
        peer, looped, monkeypatch):
    """The loop begins with new topics; then the rest of the flood is taken in one turn."""
    receiver = Recorder(0.001)
    arrive(peer, flood=100)
    with looped(receiver) as one:
        one.run(lambda: one.backlogs)
        monkeypatch.setattr(loop, '_LONGEST_TURN', 20.0)
        one.run(lambda: receiver.names.count('flood') == 100)
        assert one.backlogs == {}


def test_many_footprints_leave_obstacles_their_time(peer, looped, monkeypatch):
    """A source has half of each turn, however many footprints share the other half."""
    monkeypatch.setattr(loop, '_LONGEST_TURN', 20.0)
    receiver = Recorder(0.003)
    arrive(peer, flood=300)
    looped.until(receiver, lambda: 'flood' in receiver.names,
                 further=[f'robot{k}' for k in range(50)])
    assert receiver.names.count('flood') == 300


def test_looking_at_many_footprints_takes_no_more_time_than_obstacles(peer, looped, monkeypatch):
    """A look takes 20 ms here and a batch much less: so there is no look after each batch."""
    receiver = Recorder()
    looks = 0
    take_batch = loop._Topic.take_batch

    def take_slowly(topic, limit, now):
        nonlocal looks
        if topic.name == 'other':
            looks += 1
            time.sleep(0.02)
        return take_batch(topic, limit, now)
    monkeypatch.setattr(loop._Topic, 'take_batch', take_slowly)
    monkeypatch.setattr(loop, '_LONGEST_TURN', 20.0)
    arrive(peer, flood=2000)
    looped.until(receiver, lambda: 'flood' in receiver.names)
    assert receiver.names.count('flood') == 2000
    assert 1 < looks < 15


def test_footprints_are_received_and_published_first(peer, looped):
    receiver = Recorder()
    arrive(peer, flood=20, other=1)
    looped.until(receiver, lambda: 'flood' in receiver.names)
    assert receiver.names[:2] == ['begin', 'other'] and receiver.batches[0] == 1


def test_footprint_is_published_between_batches(peer, looped):
    """It waits for the current batch of obstacles, not for all that are queued."""
    receiver = Recorder(meets=lambda _: receiver.names.count('flood') == 4
                        and arrive(peer, other=1))
    arrive(peer, flood=300)
    looped.until(receiver, lambda: 'other' in receiver.names)
    assert receiver.names[:receiver.names.index('other')].count('flood') == 4
    assert 1 in receiver.batches  # the first one, unless a busy machine ends the turn


@pytest.mark.parametrize('topic', ['flood', 'other'])
def test_messages_come_before_the_next_part_of_what_can_wait(peer, looped, topic):
    """Where there is more to do the loop does not wait, and takes what has come meanwhile."""
    receiver = Recorder()
    go_on = receiver.go_on

    def go_on_and_meet_another(now):
        if receiver.parts == 20:
            arrive(peer, **{topic: 1})
        return go_on(now)
    receiver.go_on = go_on_and_meet_another
    receiver.parts = 30
    looped.until(receiver, lambda: not receiver.parts)
    assert receiver.names.count('tick') < 15
    assert receiver.between_ticks == [*11 * ['part'], 'begin', topic, *19 * ['part']]


def test_event_is_handled_at_once(peer, looped):
    receiver = Recorder(often=0)
    matched = []
    looped.node.create_subscription(
        PolygonStamped, 'another', id, 1, event_callbacks=SubscriptionEventCallbacks(
            matched=matched.append))
    with looped(receiver) as one:
        one.run(lambda: receiver.ticks)
        # After a tick the loop checks events anyway.
        arrive(peer, flood=1)
        one.run(lambda: 'flood' in receiver.names)
        publisher = threading.Timer(0.1, peer.publisher, ('another',))
        publisher.start()
        one.run(lambda: matched or time.monotonic() > receiver.ticked + 9.0)
        publisher.join()
    assert matched and receiver.ticks == 1


def test_long_messages_are_received_one_by_one(peer, looped):
    """Each may take long to check, however many short ones were received together before."""
    receiver = Recorder()
    together = []
    receive = receiver.receive
    receiver.receive = lambda name, messages, *rest: (
        together.append([len(data) for data in messages]), receive(name, messages, *rest))
    arrive(peer, flood=200)
    publish(peer.publisher('flood'), 20, 1000)
    looped.until(receiver, lambda: receiver.names.count('flood') == 220)
    assert max(map(len, together)) > 50
    assert max(sum(size > 10_000 for size in sizes) for sizes in together) == 1


def test_new_publisher_is_reported_before_its_first_message(peer, looped):
    """Once for each, whether its messages come alone or in a batch."""
    receiver = Recorder()
    with looped(receiver) as one:
        one.run(lambda: receiver.ticks > 2)
        arrive(peer, other=1)
        one.run(lambda: 'other' in receiver.names)
        arrive(peer, flood=20)
        one.run(lambda: receiver.names.count('flood') == 20)
    assert receiver.between_ticks == ['begin', 'other', 'begin', *20 * ['flood']]


def test_new_publisher_in_the_middle_of_a_queue(peer, looped):
    """Earlier messages are received first, then the publisher is reported, then its messages."""
    receiver = Recorder()
    arrive(peer, flood=3)
    another = peer.node.create_publisher(PolygonStamped, 'flood', 2000)
    peer.until(another.get_subscription_count)
    publish(another, 30)
    looped.until(receiver, lambda: receiver.names.count('flood') == 33)
    assert receiver.between_ticks == ['begin', *3 * ['flood'], 'begin', *30 * ['flood']]


def test_stop_is_not_delayed_by_a_flood(peer, looped):
    """The condition to end is checked after each turn."""
    receiver = Recorder(0.001)
    arrive(peer, flood=500)
    looped.until(receiver, lambda: bool(receiver.names))
    assert 0 < receiver.names.count('flood') < 50


def topic(handle, receiver, events=(), depth=2000, status=loop._MATCHED, backlogs=None):
    """Return a topic with a status that gives some events, then none."""
    events = iter(events)
    handler = SimpleNamespace(event_type=status, take_data=lambda: next(events, None))
    subscription = SimpleNamespace(
        handle=handle, msg_type=PolygonStamped, event_handlers=[handler], qos_profile=QoSProfile(
            depth=depth, liveliness_lease_duration=Duration(seconds=status != loop._MATCHED)))
    return loop._Topic(loop.Input('flood', subscription), receiver, backlogs)


@pytest.mark.parametrize('events, expected', [
    ((None, None), ['receive']), (('came', None), ['came', 'receive']),
    ((None, 'came'), ['came', 'receive_mixed'])])
@pytest.mark.parametrize('status', [loop._MATCHED, loop._LIVELINESS],
                         ids=['matched', 'liveliness'])
def test_batch_during_which_a_publisher_came_may_be_of_any(events, expected, status):
    """
    One that came before the batch did not send it before that was known.

    It was matched, or had lost its liveliness and was heard again.
    """
    queue = [(b'', {'publication_sequence_number': 7, 'received_timestamp': 0})]
    calls = []
    receiver = SimpleNamespace(
        receive=lambda *_: calls.append('receive'),
        receive_mixed=lambda *_: calls.append('receive_mixed'),
        note_event=lambda _, event: calls.append(event) or True)
    handle = SimpleNamespace(pointer=1, take_message=lambda *_: queue and queue.pop() or None)
    assert topic(handle, receiver, events, status=status).take_batch(4, 0) == 1
    assert calls == expected


@pytest.mark.parametrize('depth, expected', ((2000, 201), (50, 50)))
def test_backlog_estimates_the_queued_messages(monkeypatch, depth, expected):
    """Messages arrived 1 ms apart, and the last one received is 0.2 s old."""
    infos = ({'publication_sequence_number': k + 2, 'received_timestamp': k * 10**6}
             for k in itertools.count())
    handle = SimpleNamespace(pointer=1, take_message=lambda *_: (b'', taken.append(next(infos))
                                                                 or taken[-1]))
    taken = []
    monkeypatch.setattr(loop, 'time', SimpleNamespace(
        monotonic=time.monotonic,
        time_ns=lambda: taken[-1]['received_timestamp'] + 200 * 10**6))
    backlogs = {}
    topic(handle, Recorder(), depth=depth, backlogs=backlogs).take(0.0, 0)
    assert backlogs == {'flood': (0.2, expected)}


@pytest.mark.parametrize('topic, rate, how', [
    ('flood', 5, None), ('flood', 500, 'to be ended'), ('other', 500, 'asleep')])
def test_loop_rests_only_if_messages_are_frequent(looped, domain, monkeypatch, topic, rate, how):
    """A rest without more messages only delays answers; one that always ends gathers none."""
    rests = []
    clock = SimpleNamespace(**vars(time))
    clock.sleep = lambda seconds: rests.append(('asleep', seconds)) or time.sleep(seconds)
    monkeypatch.setattr(loop, 'time', clock)
    rest = loop.WaitSet.rest
    monkeypatch.setattr(loop.WaitSet, 'rest', lambda wait_set, seconds: (
        rests.append(('to be ended', seconds)) or rest(wait_set, seconds)))
    receiver = Recorder()
    with looped(receiver, delay=0.02) as one, streaming(domain, topic, rate):
        one.run(lambda: receiver.names.count(topic) > 0)
        receiver.ticks = 0
        one.run(lambda: receiver.ticks > 20)
    assert {one for one, _ in rests} == ({how} if how else set())
    assert all(0.0 <= seconds <= 0.02 for _, seconds in rests)
    if how:
        assert receiver.names.count(topic) / len(receiver.batches) > 2


def test_footprint_ends_a_rest(peer, looped, domain, monkeypatch):
    """It is received at once; obstacles are received together later."""
    rest = loop.WaitSet.rest
    rests = []

    def rest_meanwhile(wait_set, seconds):
        begun = time.monotonic()
        sender = threading.Timer(0.1, arrive, (peer,), {'flood': 20, 'other': 1})
        if is_first := seconds > 15.0 and not rests:
            sender.start()
        is_ended = rest(wait_set, seconds)
        if is_first:
            rests.append(time.monotonic() - begun)
            sender.join()
        return is_ended
    monkeypatch.setattr(loop.WaitSet, 'rest', rest_meanwhile)
    receiver = Recorder(often=5)
    for topic in ('flood', 'other'):
        peer.publisher(topic, qos=QoSProfile(depth=2000))
    with looped(receiver, delay=30.0) as one, streaming(domain, 'flood', 500):
        one.run(lambda: 'other' in receiver.names)
        assert 0.1 < rests[0] < 25.0
        assert receiver.names[-1] == 'other' and receiver.batches[-1] == 1
        # Let one turn receive all that has gathered, however busy the machine is.
        monkeypatch.setattr(loop, '_LONGEST_TURN', 120.0)
        receiver.due = lambda now, steady: steady + 0.1
        arrive(peer, other=1)
        before = receiver.names.count('flood')
        one.run(lambda: receiver.names.count('flood') > before)
    assert receiver.batches[-1] > 20


def test_footprints_do_not_prolong_a_rest(looped, domain):
    """Obstacles are received when it is over, however often footprints end it."""
    receiver = Recorder(often=5)
    with looped(receiver, delay=0.5) as one, streaming(domain, 'flood', 500):
        one.run(lambda: receiver.ticks > 5 and receiver.names[-1] == 'flood')
        del receiver.names[:-1]
        with streaming(domain, 'other', 10):
            one.run(lambda: receiver.names.count('other') > 20)
    others = [len([*run]) for name, run in itertools.groupby(receiver.names) if name == 'other']
    assert max(others) < 10


def test_other_subscriptions_are_served_after_each_rest(peer, looped, domain):
    """As /clock, which must not wait for a tick."""
    receiver = Recorder(often=5)
    received = []
    looped.node.create_subscription(PolygonStamped, 'more', received.append, 10)
    peer.publisher('more')
    with looped(receiver, delay=0.02) as one, streaming(domain, 'flood', 500):
        one.run(lambda: receiver.ticks > 5)
        # After a tick the loop checks all subscriptions.
        one.run(lambda: receiver.names[-5:] == 5 * ['flood'])
        arrive(peer, more=1)
        one.run(lambda: received or time.monotonic() > receiver.ticked + 20.0)
    assert received


def test_single_message_is_a_batch_of_its_own(peer, looped):
    """Messages that arrive meanwhile make one batch."""
    receiver = Recorder(are_put_off=True, meets=lambda name: (
        name == 'flood' and not receiver.batches and arrive(peer, flood=20)))
    peer.publisher('flood', qos=QoSProfile(depth=2000))
    with looped(receiver) as one:
        one.run(lambda: receiver.names[-1:] == ['other'] or arrive(peer, other=1))
        # No tick is due in between.
        del receiver.batches[:]
        timer = threading.Timer(0.01, arrive, (peer,), {'flood': 1})
        timer.start()
        one.run(lambda: receiver.names.count('flood') == 21)
        timer.join()
    assert receiver.batches[0] == 1 and sum(receiver.batches) == 21


def test_messages_can_delay_a_tick(peer, looped):
    """The loop asks when the next tick is due after each batch."""
    receiver = Recorder(are_put_off=True)
    with looped(receiver) as one:
        one.run(lambda: receiver.ticks > 2)
        arrive(peer, flood=1)
        one.run(lambda: receiver.names[-1] == 'flood')
        ticks = receiver.ticks
        arrive(peer, flood=1)
        begun = time.monotonic()
        one.run(lambda: time.monotonic() > begun + 0.3 or arrive(peer, flood=1))
    assert receiver.ticks == ticks


def test_rest_ends_when_a_tick_is_due(peer, looped):
    receiver = Recorder()
    arrive(peer, flood=10)
    begun = time.monotonic()
    looped.until(receiver, lambda: receiver.ticks > 1, delay=30.0)
    assert time.monotonic() - begun < 15.0


class Prompter(Recorder):
    """Sends messages in each turn between waiting and receiving."""

    def __init__(self, peer):
        super().__init__()
        self.peer = peer
        self.sent = 0
        self.is_new_turn = True

    def due(self, now, steady):
        self.is_new_turn = True
        return super().due(now, steady)

    def present(self, steady):
        if self.is_new_turn:
            self.is_new_turn = False
            arrive(self.peer, other=2)
            self.sent += 2
        return super().present(steady)

    def tick(self, now):
        assert self.names.count('other') == self.sent
        super().tick(now)


def test_messages_that_arrive_after_the_wait_are_received_before_a_tick(peer, looped):
    """Also those of a topic that had no messages during the wait."""
    receiver = Prompter(peer)
    looped.until(receiver, lambda: receiver.ticks > 5)


@pytest.mark.parametrize('rate', (5, 500))
def test_service_is_answered(peer, looped, domain, rate):
    """With and without rests."""
    receiver = Recorder()
    client = peer.node.create_client(ListParameters, '/receiver/list_parameters')
    with looped(receiver, delay=0.02) as one, streaming(domain, 'flood', rate):
        one.run(lambda: receiver.ticks > 5)
        assert client.wait_for_service(60.0)
        answer = client.call_async(ListParameters.Request())
        one.run(lambda: peer.spin() or answer.done() or receiver.ticks > 1000)
    assert answer.done()


@pytest.mark.parametrize('turns_before', (0, 5))
def test_other_subscriptions_are_served(peer, looped, turns_before):
    """Also one that the node creates while it runs."""
    receiver = Recorder()
    received = []
    with looped(receiver) as one:
        one.run(lambda: receiver.ticks > turns_before)
        turns = itertools.count()

        def is_received():
            if next(turns) == turns_before:
                looped.node.create_subscription(PolygonStamped, 'more', received.append, 10)
            if receiver.ticks % 5 == 0:
                peer.publisher('more').publish(PolygonStamped())
            return received or receiver.ticks > 1000
        one.run(is_received)
    assert received
