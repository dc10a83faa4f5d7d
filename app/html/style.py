"""The style sheet of all panels: three sizes of type, text at 7 : 1 or better on viser's dark ground."""

from __future__ import annotations

from etnet.render.colours import GROUND, OFF, ON, hexadecimal

SURFACE = "#242424"
"""The darkest-theme panel of viser 1.1 (Mantine's dark 7): what our text stands on."""
INSET = hexadecimal(GROUND)
"""Behind pictures and empty places."""
TEXT, SOFT = "#f2f4f6", "#c4cad2"
"""Text, and text of second rank."""
EXACT, WARNING, PROBLEM = "#86e3b0", "#ffd685", "#ffb3ad"
"""Badges."""
SIZES = (13, 15, 20)
"""Pixels: captions and numbers, text, headlines."""

_SHEET = """
.et{--t:%(text)s;--s:%(soft)s;--g:%(ground)s;--line:#ffffff24;--small:%(small)dpx;--body:%(body)dpx;--large:%(large)dpx;
 color:var(--t);font-size:var(--body);line-height:1.4;font-variant-numeric:tabular-nums;container-type:inline-size;
 display:flex;flex-direction:column;gap:8px;min-width:0;padding:2px 0}
.et *{box-sizing:border-box}
.et p{margin:0}
.et-caption{font-size:var(--small);color:var(--s);display:flex;flex-wrap:wrap;gap:2px 14px;align-items:baseline;
 justify-content:space-between}
.et-caption b,.et-label b{color:var(--t);font-weight:600}
.et-say{font-size:var(--body);color:var(--t)}
.et-note{font-size:var(--small);color:var(--s)}
.et-picture{position:relative;display:block;line-height:0;background:var(--g);border-radius:5px;overflow:hidden;
 box-shadow:0 0 0 1px var(--line)}
.et-picture>img{display:block;width:100%%;height:auto;user-select:none}
.et-pick>img{cursor:crosshair}
.et-sharp>img,.et-map>img{image-rendering:pixelated}
.et-pick:hover{box-shadow:0 0 0 2px #ffffffb0}
.et-lags>.et-picture>img{opacity:.45;transition:opacity .15s .12s}
.et-cross{position:absolute;width:17px;height:17px;margin:-8.5px 0 0 -8.5px;pointer-events:none;
 background:linear-gradient(#fff,#fff) 50%%/17px 2px no-repeat,linear-gradient(#fff,#fff) 50%%/2px 17px no-repeat;
 filter:drop-shadow(0 0 1px #000) drop-shadow(0 0 1px #000)}
.et-map .et-cross,.et-thumb .et-cross{width:9px;height:9px;margin:-4.5px 0 0 -4.5px;background-size:9px 1px,1px 9px}
.et-chips{display:flex;flex-wrap:wrap;gap:6px;align-items:center}
.et-chip{font-size:var(--small);line-height:1;padding:5px 9px;border-radius:999px;border:1px solid currentColor;
 white-space:nowrap;font-weight:600}
.et-exact{color:%(exact)s}.et-warning{color:%(warning)s}.et-problem{color:%(problem)s}.et-plain{color:var(--s)}
.et-lag{font-size:var(--small);color:%(warning)s;display:flex;gap:10px;align-items:center;min-height:18px}
.et-lag>span{white-space:nowrap}
.et-bar{flex:1;height:4px;min-width:40px;border-radius:2px;background:#ffffff26;overflow:hidden}
.et-bar>i{display:block;height:100%%;background:%(warning)s}
.et-bar-wait>i{width:30%%!important;animation:et-wander 1.3s ease-in-out infinite alternate}
@keyframes et-wander{from{margin-left:0}to{margin-left:70%%}}
.et-failed{font-size:var(--body);color:%(problem)s;border-left:3px solid %(problem)s;padding:2px 0 2px 10px}
.et-empty{display:flex;flex-direction:column;gap:4px;align-items:center;justify-content:center;text-align:center;
 background:var(--g);border-radius:5px;box-shadow:0 0 0 1px var(--line);padding:22px 18px;min-height:120px;
 text-wrap:balance}
.et-empty>strong{font-size:var(--body);font-weight:600}.et-empty>span{font-size:var(--small);color:var(--s);
 max-width:44ch}
.et-legend{font-size:var(--small);color:var(--s)}
.et-legend-title{margin-bottom:4px}
.et-legend-bar{height:10px;border-radius:3px;box-shadow:0 0 0 1px var(--line)}
.et-legend-ticks{position:relative;height:18px;margin-top:2px}
.et-legend-ticks>span{position:absolute;white-space:nowrap}
.et-tick{transform:translateX(-50%%)}.et-tick-last{transform:translateX(-100%%)}
.et-swatches{display:flex;flex-wrap:wrap;gap:2px 14px;font-size:var(--small);color:var(--s)}
.et-swatch{white-space:nowrap}
.et-swatch>i{display:inline-block;width:10px;height:10px;border-radius:50%%;margin-right:6px}
.et-row{display:grid;gap:4px}
.et-thumb{display:flex;flex-direction:column;gap:2px;min-width:0}
.et-label{font-size:var(--small);color:var(--s);line-height:1.25}
.et-thumb>.et-label{text-align:center;white-space:nowrap}
.et-sites{display:grid;grid-template-columns:minmax(68px,1fr) repeat(var(--columns),auto);gap:8px 4px;
 align-items:start}
.et-sites>.et-head{text-align:center;line-height:1.2;align-self:end}
.et-head b{font-size:var(--body);font-weight:600}.et-head span{display:block;font-size:var(--small);color:var(--s)}
.et-name{font-size:var(--small);line-height:1.25;padding-top:2px}
.et-name b{display:block;font-weight:600;white-space:nowrap}
.et-name span{color:var(--s)}
.et-map{background:var(--base) 0 0/100%% 100%% var(--g);border-radius:2px}
.et-map>img{width:100%%}
.et-sites .et-map,.et-heads .et-map{margin:0 auto}
.et-sites .et-map{width:round(down,calc((100cqw - 68px - 4px*var(--columns))/var(--columns)),calc(var(--n)*1px));
 min-width:calc(var(--n)*1px)}
.et-heads{display:grid;grid-template-columns:repeat(4,auto);justify-content:space-between;gap:8px 4px}
.et-heads .et-map{width:round(down,calc((100cqw - 12px)/4),calc(var(--n)*1px));min-width:calc(var(--n)*1px)}
.et-chosen>.et-picture{box-shadow:0 0 0 2px #fff}
.et-back{align-self:flex-start;font:inherit;font-size:var(--small);color:var(--t);background:#ffffff14;cursor:pointer;
 border:1px solid var(--line);border-radius:6px;padding:6px 12px;min-height:32px}
.et-back:hover{background:#ffffff26}
.et-now{display:flex;flex-wrap:wrap;align-items:baseline;gap:2px 16px}
.et-now>b{font-size:var(--large);font-weight:600;line-height:1.2}
.et-now>span{font-size:var(--small);color:var(--s)}
.et-strip{position:relative;height:44px;margin:0 var(--inset,0);border-radius:4px;background:var(--g);
 box-shadow:0 0 0 1px var(--line)}
.et-strip>svg{position:absolute;inset:0;width:100%%;height:100%%;overflow:hidden;border-radius:4px}
.et-strip.et-pick{cursor:pointer}
.et-head-line{position:absolute;top:-3px;bottom:-3px;width:2px;margin-left:-1px;background:#fff;pointer-events:none;
 box-shadow:0 0 3px #000}
.et-seconds{position:relative;height:16px;line-height:16px;margin:-4px var(--inset,0) 0;font-size:var(--small);
 color:var(--s)}
.et-seconds>span{position:absolute;white-space:nowrap}
.et-facts{display:flex;flex-wrap:wrap;gap:6px 22px;align-items:center;margin:0}
.et-facts>div{display:flex;flex-direction:column;min-width:0}
.et-facts dt{font-size:var(--small);color:var(--s);line-height:1.3}
.et-facts dd{margin:0;font-size:var(--body);line-height:1.3;overflow-wrap:anywhere}
.et-band{position:relative;display:inline-block;width:84px;height:8px;margin-left:8px;border-radius:4px;
 background:#ffffff1f;vertical-align:middle}
.et-band>i{position:absolute;top:0;bottom:0;background:%(exact)s80;border-radius:4px}
.et-band>b{position:absolute;top:-3px;width:4px;height:14px;margin-left:-2px;border-radius:2px;background:#fff;
 box-shadow:0 0 0 1px #000}
.et-lead{font-size:var(--body)}
.et-demo{--small:18px;--body:18px;--large:24px}
@media (prefers-reduced-motion:reduce){.et-bar-wait>i{animation:none}.et-lags>.et-picture>img{transition:none}}
"""

STYLE = (
    "<style>"
    + _SHEET
    % {
        "text": TEXT,
        "soft": SOFT,
        "ground": INSET,
        "exact": EXACT,
        "warning": WARNING,
        "problem": PROBLEM,
        "small": SIZES[0],
        "body": SIZES[1],
        "large": SIZES[2],
    }
    + f".et{{--on:{hexadecimal(ON)};--off:{hexadecimal(OFF)}}}</style>"
)
"""To be put on the page once."""
