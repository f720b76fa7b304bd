//! A frame of a store as a PNG.

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut words = std::env::args().skip(1);
    let (store, image) = words.next().zip(words.next()).ok_or("uses-tetreel STORE.zarr OUT.png")?;
    let mut scene = tetreel::scene::Scene::open(store)?;
    let frame = scene.render(scene.pipeline.times().len() - 1)?;
    println!("{:.1} ms", frame.stats.ms_frame);
    Ok(tetreel::image::write_png(image.as_ref(), &frame.planes.color, None, Default::default())?)
}
