"""Every page that the tool writes, in a real browser: on a telephone, in the dark, and printed."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from hand_client.live_state import ERROR, LiveState
from hand_model.description import load_hand
from hand_recording.installed import default_model
from hand_studio.inbox import Inbox
from hand_studio.page import Page
from hand_studio.panel import Panel
from test.pages.kinds import MADE, PAGES, write
from validation.browser import Browser

PHONE, DESKTOP = (360, 780), (1280, 900)
LEAST_CONTRAST = 4.5
"""WCAG 2.2, 1.4.3, level AA for text of any size."""
CONTRASTS = """
(() => {
  const parse = (text) => { const n = text.match(/[\\d.]+/g).map(Number); return n.length < 4 ? [...n, 1] : n; };
  const over = (top, below) => [0, 1, 2].map((k) => top[3] * top[k] + (1 - top[3]) * below[k]);
  const light = (rgb) => rgb.map((v) => v / 255).map((v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
    .reduce((sum, v, k) => sum + v * [0.2126, 0.7152, 0.0722][k], 0);
  const behind = (element) => {
    const layers = [];
    for (let e = element; e; e = e.parentElement) layers.push(parse(getComputedStyle(e).backgroundColor));
    return layers.reverse().reduce((below, top) => over(top, below), [255, 255, 255]);
  };
  const faint = (element) => {
    for (let e = element; e; e = e.parentElement) if (getComputedStyle(e).opacity < 1) return true;
    return false;
  };
  const found = [], walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node = walker.nextNode(); node; node = walker.nextNode()) {
    const parent = node.parentElement;
    if (!node.textContent.trim() || !parent.getClientRects().length || faint(parent)) continue;
    if (["SCRIPT", "STYLE", "NOSCRIPT", "OPTION"].includes(parent.tagName)) continue;
    const style = getComputedStyle(parent), paper = behind(parent);
    const ink = over(parse(parent instanceof SVGElement ? style.fill : style.color), paper);
    const [low, high] = [light(ink), light(paper)].sort((a, b) => a - b);
    found.push([(high + 0.05) / (low + 0.05), node.textContent.trim().slice(0, 40)]);
  }
  return found.sort((a, b) => a[0] - b[0]).slice(0, 5).concat([[found.length, "texts"]]);
})()
"""
WIDER = """
[...document.querySelectorAll("main *, #root *")].filter((e) => {
  for (let p = e.parentElement; p; p = p.parentElement) if (getComputedStyle(p).overflowX === "auto") return false;
  return !(e instanceof SVGElement) && e.getBoundingClientRect().right > innerWidth + 0.5;
}).map((e) => `${e.tagName} ${e.className}`).slice(0, 5)
"""

FOLDED = "[...document.querySelectorAll('details:not([open]) > :not(summary)')]"
SEEN = "(e) => e.checkVisibility({contentVisibilityAuto: true}) && e.getBoundingClientRect().height > 0"


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    opened = Browser(tmp_path_factory.mktemp("browser"), "about:blank")
    yield opened
    opened.close()


def check_contrast(browser: Browser, where: str) -> None:
    *worst, (count, _) = browser.run(CONTRASTS)
    assert count > 10, f"{where}: only {count} texts were looked at"
    assert all(ratio >= LEAST_CONTRAST for ratio, _ in worst), (where, worst)


def paper_and_ink(browser: Browser) -> tuple[float, float]:
    """Of the first picture the brightness of a corner, where its figure is empty, and of what differs most from it.

    0 is black and 1 white.
    """
    browser.run("scrollTo(0, 0)")
    box = browser.run("(r => [r.x, r.y, r.width, r.height])(document.querySelector('img').getBoundingClientRect())")
    x, y, width, height = (round(each) for each in box)
    page = imread(io.BytesIO(browser.whole()), format="png")
    shown = page[y + 6 : y + height - 6, x + 6 : x + width - 6, :3].mean(axis=2)
    paper = float(shown[:6, :6].mean())
    return paper, float(shown.flat[np.argmax(np.abs(shown - paper))])


@pytest.mark.parametrize("kind", PAGES)
def test_every_page_fits_a_telephone_is_legible_in_the_dark_and_prints(
    browser: Browser, kind: str, tmp_path: Path
) -> None:
    """Fails when a page is wider than a telephone, a text has too little contrast in light, dark or print, a picture is
    a white block in the dark, cannot be seen in print or has no result in words, a plot is not drawn, what is folded
    is not printed, or the page has no style for print.
    """
    page = write(kind, tmp_path)
    browser.emulate(PHONE)
    browser.open(page.as_uri())
    browser.until(f"location.href === '{page.as_uri()}' && document.querySelector('.made')")
    browser.run("document.querySelectorAll('details').forEach((each) => { each.open = true; })")
    for number in range(browser.run("document.querySelectorAll('figure.plot').length")):
        browser.run(
            f"document.querySelectorAll('figure.plot')[{number}].scrollIntoView()"
        )  # it is drawn when it is near
        browser.until(f"document.querySelectorAll('figure.plot')[{number}].querySelector('svg')")
    assert browser.run("document.documentElement.scrollWidth") == PHONE[0], browser.run(WIDER)
    assert browser.run(WIDER) == []
    assert browser.run("[...document.images].every((image) => image.alt.trim())")
    check_contrast(browser, "light")
    browser.emulate(PHONE, dark=True)
    check_contrast(browser, "dark")
    has_picture = browser.run("document.images.length > 0")
    if has_picture:
        paper, ink = paper_and_ink(browser)
        assert paper < 0.2 and ink > 0.7
    browser.emulate(DESKTOP, dark=True, printed=True)
    browser.until(f"innerWidth === {DESKTOP[0]}")
    browser.run("document.querySelectorAll('details').forEach((each) => { each.open = false; })")
    assert browser.run(f"{FOLDED}.every({SEEN})")  # a page that is folded prints all
    if browser.run("document.querySelectorAll('figure.plot').length"):
        browser.run("dispatchEvent(new Event('beforeprint'))")
        assert browser.run("document.querySelectorAll('details:not([open])').length") == 0
        browser.run("dispatchEvent(new Event('afterprint'))")
    check_contrast(browser, "print")
    assert browser.run("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    assert browser.run("getComputedStyle(document.body).maxWidth") == "none"
    if has_picture:
        paper, ink = paper_and_ink(browser)
        assert paper > 0.9 and ink < 0.3
    browser.emulate(DESKTOP)
    assert not browser.run(f"{FOLDED}.some({SEEN})")  # on a screen it is folded
    assert browser.run("document.documentElement.scrollWidth") <= DESKTOP[0]


def test_the_studio_fits_a_telephone(browser: Browser) -> None:
    """Fails when a tab of the studio is wider than a telephone, or does not explain ghost and colours."""
    hand, page = load_hand(default_model()), Page()
    try:
        panel = Panel(page, hand, ["cylindrical", "lateral", "tripod"], Inbox(lambda: None))
        state = LiveState(statuses={"controller: safety": (ERROR, "vented: " + "a_reason_without_a_space" * 4)})
        state.frame(hand.joints, [1.0] * len(hand.joints), 0, 1)
        panel.show(state, f"recording to {MADE['command']}", np.full(len(hand.joints), 499.0))
        browser.emulate(PHONE)
        browser.open(page.url)
        browser.until_shown("Blue ghost: the model")
        for tab, shown in (("Drive", "grasp"), ("Model", "What if"), ("Find", "Record until"), ("Values", "57.3")):
            browser.click(tab)
            browser.until_shown(shown)
            assert browser.run("document.documentElement.scrollWidth") == PHONE[0]
            assert browser.run(WIDER) == [], tab
        assert browser.run("(each => each.scrollWidth <= each.clientWidth)(document.querySelector('#note'))")
    finally:
        browser.open("about:blank")
        page.close()


def test_no_line_of_text_moves_the_emergency_stop(browser: Browser) -> None:
    """Fails when a fault that is reported pushes the button away from the mouse that is about to press it."""
    hand, page = load_hand(default_model()), Page()
    try:
        panel = Panel(page, hand, ["tripod"], Inbox(lambda: None))
        browser.emulate(DESKTOP)
        browser.open(page.url)
        stop = "[...document.querySelectorAll('button')].find(b => b.innerText === 'Emergency stop')"
        browser.until(stop)
        before = browser.run(f"{stop}.getBoundingClientRect().y")
        faults = {f"driver: channel {number}": (ERROR, "it repeats one value") for number in range(9)}
        panel.show(LiveState(statuses=faults), "", np.zeros(len(hand.joints)))
        browser.until_shown("channel 8")
        assert browser.run(f"{stop}.getBoundingClientRect().y") == before
    finally:
        browser.open("about:blank")
        page.close()


def test_probabilities_differ_without_reading_them(browser: Browser, tmp_path: Path) -> None:
    """Fails when a finding that is probable looks like one that is very probable, on a screen or in print."""
    browser.emulate(DESKTOP)
    browser.open(write("diagnosis", tmp_path).as_uri())
    browser.until("document.querySelectorAll('.probability').length === 3")
    for printed in (False, True):
        browser.emulate(DESKTOP, printed=printed)
        texts = browser.run("[...document.querySelectorAll('.probability')].map(e => e.innerText.trim())")
        assert texts == ["96%, very probable", "55%, possible", "40%, possible"]
        bars = browser.run("[...document.querySelectorAll('.probability u')].map(e => e.getBoundingClientRect().width)")
        assert bars[1] / bars[0] == pytest.approx(55 / 96, abs=0.03) and bars[0] > 60.0
        weights = browser.run("[...document.querySelectorAll('.probability')].map(e => getComputedStyle(e).fontWeight)")
        assert weights == ["700", "400", "400"]


def test_the_notes_of_the_paper_are_readable_on_a_telephone(browser: Browser, tmp_path: Path) -> None:
    """Fails when a note next to a number is hidden, or can only be reached by scrolling sideways."""
    browser.emulate(PHONE)
    browser.open(write("reproduce", tmp_path).as_uri())
    browser.until("document.querySelectorAll('.numbers').length === 2")
    note = "document.querySelector('.numbers td:nth-child(5)')"
    left, right, height = browser.run(f"(r => [r.left, r.right, r.height])({note}.getBoundingClientRect())")
    assert 0.0 <= left < right <= PHONE[0] and height > 10.0
    assert browser.run(f"{note}.innerText").startswith("a note that is longer")
