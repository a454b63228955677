//! A recording as one page that replays it, with its frames inside and nothing to fetch.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde::Serialize;

use crate::episode::frames::FrameSequence;
use crate::report::html::in_script;
use crate::report::pixmap::Pixmap;

#[derive(Serialize)]
struct ReplayPage<'a> {
    title: &'a str,
    subtasks: &'a [String],
    steps: Vec<ReplayStep<'a>>,
}

#[derive(Serialize)]
struct ReplayStep<'a> {
    step: u32,
    told: &'a str,
    words: String,
    possible: bool,
    done: Option<&'a str>,
    frame: String,
}

/// Makes the page that replays a recording.
///
/// # Errors
/// Never in practice: it is written to memory.
pub(crate) fn write(recording: &FrameSequence) -> anyhow::Result<String> {
    let mut camera = recording.camera();
    let mut steps = Vec::with_capacity(recording.shots.len());
    for shot in &recording.shots {
        let frame = camera.draw(shot);
        let pixmap = Pixmap { width: frame.width, height: frame.height, rgb: frame.rgb };
        steps.push(ReplayStep {
            step: shot.step,
            told: &shot.told,
            words: shot.words(),
            possible: shot.possible,
            done: shot.done.as_deref(),
            frame: format!("data:image/png;base64,{}", STANDARD.encode(pixmap.png()?)),
        });
    }
    let page = ReplayPage { title: &recording.title, subtasks: &recording.subtasks, steps };
    let data = in_script(&page)?;
    Ok(TEMPLATE.replace("\"DATA\"", &data))
}

const TEMPLATE: &str = r#"<!doctype html>
<html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>sprint replay</title>
<style>
body{font:15px/1.45 system-ui,sans-serif;max-width:64rem;margin:1.5rem auto;padding:0 1rem;color:#1c1e22;background:#fafafa}
main{display:grid;grid-template-columns:minmax(300px,420px) 1fr;gap:1.5rem}
img{width:100%;image-rendering:pixelated;border-radius:4px;display:block}
ol{margin:0;padding:0;list-style:none;max-height:26rem;overflow:auto;font:13px/1.5 ui-monospace,monospace}
li{padding:0 .4rem;cursor:pointer;border-radius:3px}li.now{background:#1c1e22;color:#fff}
li.bad{color:#b3261e}li.done{color:#14783c;font-weight:600}li.now.bad,li.now.done{color:#fff}
input{width:100%}h1{font-size:1.15rem;margin:.2rem 0}p{margin:.2rem 0;color:#555}button{font:inherit;padding:.2rem .9rem}
@media(prefers-color-scheme:dark){body{background:#17181b;color:#e6e6e6}p{color:#aaa}li.now{background:#e6e6e6;color:#17181b}
li.bad{color:#ff8a80}li.done{color:#6fdc98}li.now.bad,li.now.done{color:#17181b}}
</style>
<h1 id="told"></h1><p id="title"></p>
<main><div><img id="frame" alt="what the agent sees"><input id="at" type="range" min="0" value="0">
<p><button id="play">play</button> <span id="words"></span></p><p id="subtasks"></p></div><ol id="steps"></ol></main>
<script>
const run="DATA";const $=id=>document.getElementById(id);let at=0,timer=null;
$("at").max=run.steps.length-1;$("title").textContent=run.title;
run.steps.forEach((s,i)=>{const li=document.createElement("li");
 li.textContent=s.step+"  "+s.words+(s.done?" · done: "+s.done:"");li.onclick=()=>show(i);$("steps").append(li)});
function show(i){at=Math.max(0,Math.min(run.steps.length-1,i));const s=run.steps[at];$("frame").src=s.frame;$("told").textContent=s.told;
 $("words").textContent="step "+s.step+": "+s.words;$("at").value=at;
 const done=run.steps.slice(0,at+1).filter(s=>s.done).length;
 $("subtasks").textContent=run.subtasks.map((t,n)=>(n<done?"\u2713 ":"\u25cb ")+t).join("   ");
 [...$("steps").children].forEach((li,n)=>{const s=run.steps[n];li.className=(n===at?"now ":"")+(s.possible?"":"bad ")+(s.done?"done":"")});
 $("steps").children[at].scrollIntoView({block:"nearest"})}
function play(){if(timer){clearInterval(timer);timer=null;$("play").textContent="play"}
 else{if(at===run.steps.length-1)show(0);timer=setInterval(()=>{show(at+1);if(at===run.steps.length-1)play()},250);$("play").textContent="pause"}}
$("play").onclick=play;$("at").oninput=e=>show(+e.target.value);
document.onkeydown=e=>{if(e.key==="ArrowLeft"||e.key==="h")show(at-1);else if(e.key==="ArrowRight"||e.key==="l")show(at+1);
 else if(e.key===" "){e.preventDefault();play()}else if(e.key==="Home")show(0);else if(e.key==="End")show(1e9)};
show(0);
</script>
"#;
