//! What a GPU draws splats of flow from (`shaders/lib/flow_splats.wgsl`).

use super::context::Context;
use super::layout::Params;
use super::resources::Resource;
use super::splat_lists::SplatLists;
use super::texels::{Sent, TexelList};
use crate::render::cpu::layers::Inside;
use crate::render::flow::{FlowSplats, Pattern};
use crate::render::{RenderError, RenderJob};

/// Textures of splats by tiles, of icons, and of depths inside of cells.
pub(super) struct FlowTextures {
    pub(super) lists: SplatLists,
    icons_of: Vec<Pattern>,
    icons: TexelList,
    inside_of: Option<Sent<Inside>>,
    inside: TexelList,
}

impl FlowTextures {
    pub(super) fn new() -> Self {
        Self {
            lists: SplatLists::new(),
            icons_of: Vec::new(),
            icons: TexelList::new(Resource::FlowIcons),
            inside_of: None,
            inside: TexelList::new(Resource::FlowInside),
        }
    }

    /// The textures, as stages bind them.
    pub(super) fn views(&self) -> impl Iterator<Item = (Resource, &wgpu::TextureView)> {
        self.lists.views().chain([&self.icons, &self.inside].into_iter().filter_map(TexelList::view))
    }

    /// Uploads what the splats of a job need, if it has some, unless it is there. Returns whether a texture was made, and the bytes sent.
    pub(super) fn update(
        &mut self,
        context: &Context,
        job: &RenderJob,
        params: &Params,
    ) -> Result<(bool, u64), RenderError> {
        let Some(flow) = &job.flow else { return Ok((self.release(context)?, 0)) };
        let origin = params.depth_behind_eye();
        let parts = [
            self.lists.update(context, flow, params)?,
            self.update_icons(context, flow)?,
            self.update_inside(context, flow, origin)?,
        ];
        Ok((parts.iter().any(|(made, _)| *made), parts.iter().map(|(_, sent)| sent).sum()))
    }

    /// Frees what splats need.
    fn release(&mut self, context: &Context) -> Result<bool, RenderError> {
        (self.icons_of, self.inside_of) = (Vec::new(), None);
        let mut made = self.lists.release(context)?;
        for list in [&mut self.icons, &mut self.inside] {
            made |= list.release(context, false)?;
        }
        Ok(made)
    }

    fn update_icons(&mut self, context: &Context, flow: &FlowSplats) -> Result<(bool, u64), RenderError> {
        if self.icons_of == flow.patterns() {
            return Ok((false, 0));
        }
        self.icons_of.clear();
        flow.icon_texels(&mut self.icons.texels);
        let sent = self.icons.send(context)?;
        self.icons_of = flow.patterns().to_vec();
        Ok(sent)
    }

    fn update_inside(&mut self, context: &Context, flow: &FlowSplats, origin: f64) -> Result<(bool, u64), RenderError> {
        let Some(inside) = flow.inside() else {
            self.inside_of = None;
            return Ok((self.inside.release(context, true)?, 0));
        };
        if self.inside_of.as_ref().is_some_and(|sent| sent.is_of(inside, origin)) {
            return Ok((false, 0));
        }
        self.inside_of = None;
        flow.inside_texels(origin, &mut self.inside.texels);
        let sent = self.inside.send(context)?;
        self.inside_of = Some(Sent::new(inside, origin));
        Ok(sent)
    }
}
