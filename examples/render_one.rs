//! Renders one step of a series: `cargo run --release --example render_one STORE.zarr STEP OUT.png`.

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut words = std::env::args().skip(1);
    let mut next = || words.next().ok_or("render_one STORE.zarr STEP OUT.png");
    let mut scene = tetreel::scene::Scene::open(next()?)?;
    let frame = scene.render(next()?.parse::<usize>()?)?;
    tetreel::image::write_png(next()?.as_ref(), &frame.planes.color, None, Default::default())?;
    Ok(())
}
